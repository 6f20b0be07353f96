"""A run as it was last read: a row for each completion, judged or not, and what is counted of them."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any, Self
from urllib.parse import urlencode

import polars as pl
from fastapi import Query

from codebotler.core.cachedproperty import cached_property
from codebotler.models.no_program import NO_PROGRAM_SENTENCES
from roboeval.analysis.counts import tally_of, task_scores
from roboeval.analysis.metrics import Estimate, TaskScore, judged_count, overall, passed_count, prompts_of
from roboeval.analysis.summary import Failures, cut_off, failures
from roboeval.analysis.tasks import prompt_counts
from roboeval.evaluation.failures import NO_PROGRAM
from roboeval.evaluation.runs.completions import KEY, Key
from roboeval.evaluation.runs.results import Results
from roboeval.evaluation.runs.scope import Coverage, CutOff, Scope
from roboeval.evaluation.runs.table import storable
from roboeval.suites.load import Suite
from roboeval.suites.task import check_label

HAS_NO_PROGRAM = pl.col("failure_class").eq_missing(NO_PROGRAM)
# How a program did in a world: + satisfied, - not, ! ended by an error.
SIGN = (
    pl.when("satisfied")
    .then(pl.lit("+"))
    .when((pl.col("status") == "finished") | pl.col("error_kind").is_null())
    .then(pl.lit("-"))
    .otherwise(pl.lit("!"))
)
# What decided: the failed check, the limit that stopped the program, or its error.
ERROR = pl.col("error_message")
WHY = (
    pl.when(HAS_NO_PROGRAM)
    .then(pl.col("failure_kind").replace(dict(NO_PROGRAM_SENTENCES)))
    .when(pl.col("failure_check").is_not_null())
    .then(pl.col("failure_check").map_elements(check_label, return_dtype=pl.String))
    .when((pl.col("status") == "timeout") & ERROR.str.contains(r"^\d"))
    .then(pl.format("stopped after {} (limit)", ERROR))
    .otherwise(ERROR)
)
MOST = 2**63


@dataclass(frozen=True)
class Filter:
    """Which completions are meant, as addresses of the pages and of the API say it: values by column."""

    task: Annotated[str | None, Query(description="Only of this task.")] = None
    prompt: Annotated[
        int | None, Query(ge=0, lt=MOST, description="Only of this prompt, counted from 0.")
    ] = None
    passed: Annotated[bool | None, Query(description="Only those that passed, or those that failed.")] = None
    failure_class: Annotated[str | None, Query(description="Only those that failed by this class.")] = None
    failure_kind: Annotated[str | None, Query(description="Only those that failed by this kind.")] = None

    @property
    def condition(self) -> pl.Expr:
        """It as a condition on `Snapshot.completions`."""
        conditions = [pl.col(name) == value for name, value in asdict(self).items() if value is not None]
        return pl.all_horizontal(pl.lit(value=True), *conditions)

    @property
    def verdict(self) -> Self:
        """The same in all tasks and prompts."""
        return replace(self, task=None, prompt=None)

    def query(self, evaluation: str | None) -> str:
        """It as the query of an address; empty if it means all completions of the usual evaluation."""
        values = {"evaluation": evaluation, **asdict(self)}
        if self.passed is not None:
            values["passed"] = str(self.passed).lower()
        query = urlencode({name: v for name, v in values.items() if v is not None}, errors="replace")
        return f"?{query}" if query else ""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """One evaluation of a run as it was last read."""

    results: Results
    evaluations: tuple[str, ...]  # names of all of the run
    is_written: bool  # by a process, now
    version: Hashable  # differs whenever something has changed

    @property
    def name(self) -> str:
        """The name of the run."""
        return self.results.run.path.name

    @property
    def suite(self) -> Suite | None:
        """The suite by which it was judged, or is to be; None if it is not at hand."""
        return self.results.suite

    @cached_property
    def models(self) -> list[str]:
        """The models that wrote the completions, as far as that was recorded."""
        return sorted({c.model for c in self.results.completions.values() if c.model is not None})

    @cached_property
    def completions(self) -> pl.DataFrame:
        """A row for each completion in the suite's order, also where only the verdict is there.

        `passed` is null where nothing was judged, `worlds` has a sign for each world in which a program
        ran, `why` is the check or
        the error that decided, and `written` whether the completion stands in the run now.
        """
        judged = self.results.table.group_by(KEY, maintain_order=True).agg(
            pl.col("passed", "^failure_.*$", "stale").first(),
            pl.when(HAS_NO_PROGRAM.first()).then(pl.lit("")).otherwise(SIGN.str.join("")).alias("worlds"),
            WHY.filter(pl.col("world_number") == pl.col("failure_world")).first().alias("why"),
        )
        keys = [(storable(task), prompt, index, True) for task, prompt, index in self.results.completions]
        schema = {"task": pl.String, "prompt": pl.Int64, "index": pl.Int64, "written": pl.Boolean}
        written = pl.DataFrame(keys, schema=schema, orient="row")
        tasks = () if self.suite is None else tuple(self.suite.tasks)
        place = pl.col("task").replace_strict(
            tasks, range(len(tasks)), default=len(tasks), return_dtype=pl.Int64
        )
        filled = (pl.col("stale", "written").fill_null(value=False), pl.col("worlds", "why").fill_null(""))
        return judged.join(written, on=KEY, how="full", coalesce=True).with_columns(*filled).sort(place, *KEY)

    def row(self, name: str) -> dict[str, Any] | None:
        """The row of a completion, by its name; None if there is none."""
        found = self.completions.filter(pl.format("{}/{}/{}", *KEY) == name)
        return found.row(0, named=True) if found.height else None

    def select(self, chosen: Filter) -> pl.DataFrame:
        """The completions that a filter means, in order."""
        return self.completions.filter(chosen.condition)

    def neighbours(self, key: Key, chosen: Filter) -> tuple[Key | None, Key | None]:
        """The completions before and after one, among those that a filter means; None at an end."""
        keys = [None, *self.select(chosen).select(KEY).iter_rows(), None]
        at = keys.index(key) if key in keys else None
        return (None, None) if at is None else (keys[at - 1], keys[at + 1])

    def prompts(self, chosen: Filter) -> list[dict[str, Any]]:
        """All prompts, and how many completions are `written`, `judged` and `counted` (meant by a filter)."""
        return prompt_counts(self.completions, chosen.verdict.condition).to_dicts()  # whatever its prompt

    @property
    def judged(self) -> int:
        """How many completions were judged."""
        return judged_count(prompts_of(self.scores))

    @property
    def passed(self) -> int:
        """How many completions passed."""
        return passed_count(prompts_of(self.scores))

    @cached_property
    def scope(self) -> Scope:
        """What there is to judge."""
        return self.results.scope

    @property
    def coverage(self) -> Coverage:
        """Of how many completions its numbers speak."""
        return self.scope.coverage(self.judged)

    @property
    def cut_off(self) -> CutOff:
        """The replies that were cut off."""
        return cut_off(self.failures, self.scope)

    @cached_property
    def scores(self) -> tuple[TaskScore, ...]:
        """How often completions passed, by task and prompt."""
        return task_scores(self.results.table)

    @cached_property
    def pass_at_1(self) -> Estimate | None:
        """pass@1 over all prompts, with its interval over tasks; None where nothing was judged."""
        return overall(self.scores, 1) if self.scores else None

    @cached_property
    def failures(self) -> list[Failures]:
        """The classes of failures that there are, each with its kinds, the most frequent first."""
        classes = failures(tally_of(self.results.table)) if self.judged else ()
        return [
            replace(
                of, kinds=tuple(sorted((k for k in of.kinds if k.count), key=lambda k: (-k.count, k.name)))
            )
            for of in classes
            if of.count
        ]
