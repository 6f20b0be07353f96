"""A snapshot of a run: its completions, judged or not, and their counts."""

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
from roboeval.analysis.summary import Failures, cut_off_replies, failures
from roboeval.analysis.tasks import prompt_counts
from roboeval.evaluation.failures import NO_PROGRAM_CLASS
from roboeval.evaluation.runs.completions import KEY, CompletionKey
from roboeval.evaluation.runs.results import Results
from roboeval.evaluation.runs.scope import Coverage, CutOff, JudgingScope
from roboeval.evaluation.runs.table import storable
from roboeval.suites.load import Suite
from roboeval.suites.task import check_label

HAS_NO_PROGRAM = pl.col("failure_class").eq_missing(NO_PROGRAM_CLASS)
# The result of a program in a world: + satisfied, - not satisfied, ! error.
WORLD_SIGN = (
    pl.when("satisfied")
    .then(pl.lit("+"))
    .when((pl.col("status") == "finished") | pl.col("error_kind").is_null())
    .then(pl.lit("-"))
    .otherwise(pl.lit("!"))
)
# The cause of a failure: the failed check, the limit that stopped the program, or its error.
ERROR_MESSAGE = pl.col("error_message")
FAILURE_CAUSE = (
    pl.when(HAS_NO_PROGRAM)
    .then(pl.col("failure_kind").replace(dict(NO_PROGRAM_SENTENCES)))
    .when(pl.col("failure_check").is_not_null())
    .then(pl.col("failure_check").map_elements(check_label, return_dtype=pl.String))
    .when((pl.col("status") == "timeout") & ERROR_MESSAGE.str.contains(r"^\d"))
    .then(pl.format("stopped after {} (limit)", ERROR_MESSAGE))
    .otherwise(ERROR_MESSAGE)
)
INT64_LIMIT = 2**63


@dataclass(frozen=True)
class CompletionFilter:
    """Selects completions by the values of columns; also the query of pages and of the API."""

    task: Annotated[str | None, Query(description="Only this task.")] = None
    prompt: Annotated[
        int | None, Query(ge=0, lt=INT64_LIMIT, description="Only this prompt, counted from 0.")
    ] = None
    passed: Annotated[bool | None, Query(description="Only those that passed, or that failed.")] = None
    failure_class: Annotated[str | None, Query(description="Only this class of failure.")] = None
    failure_kind: Annotated[str | None, Query(description="Only this kind of failure.")] = None

    @property
    def condition(self) -> pl.Expr:
        """The filter as a condition on `Snapshot.completions`."""
        conditions = [pl.col(name) == value for name, value in asdict(self).items() if value is not None]
        return pl.all_horizontal(pl.lit(value=True), *conditions)

    @property
    def verdict(self) -> Self:
        """The filter without its task and prompt."""
        return replace(self, task=None, prompt=None)

    def query(self, evaluation: str | None) -> str:
        """The filter as the query of a URL; empty if it selects all completions of the default evaluation."""
        values = {"evaluation": evaluation, **asdict(self)}
        if self.passed is not None:
            values["passed"] = str(self.passed).lower()
        query = urlencode({name: v for name, v in values.items() if v is not None}, errors="replace")
        return f"?{query}" if query else ""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """One evaluation of a run, read at one time."""

    results: Results
    evaluations: tuple[str, ...]  # the names of all evaluations of the run
    is_written: bool  # whether a process is writing it
    version: Hashable  # changes whenever a file does

    @property
    def name(self) -> str:
        """The name of the run."""
        return self.results.run.path.name

    @property
    def suite(self) -> Suite | None:
        """The suite that judges the run; None if it is unavailable."""
        return self.results.suite

    @cached_property
    def models(self) -> list[str]:
        """The recorded models of the completions."""
        return sorted({c.model for c in self.results.completions.values() if c.model is not None})

    @cached_property
    def completions(self) -> pl.DataFrame:
        """A row for each completion in the suite's order, even if only its verdict is left.

        `passed` is null if it was not judged, `worlds` has a sign for each world, `why` is the check or the
        error that caused the failure, and `written` tells whether the run still has the completion.
        """
        judged = self.results.table.group_by(KEY, maintain_order=True).agg(
            pl.col("passed", "^failure_.*$", "stale").first(),
            pl.when(HAS_NO_PROGRAM.first())
            .then(pl.lit(""))
            .otherwise(WORLD_SIGN.str.join(""))
            .alias("worlds"),
            FAILURE_CAUSE.filter(pl.col("world_number") == pl.col("failure_world")).first().alias("why"),
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
        """Find the row of a completion by its name; None if there is none."""
        found = self.completions.filter(pl.format("{}/{}/{}", *KEY) == name)
        return found.row(0, named=True) if found.height else None

    def select(self, chosen: CompletionFilter) -> pl.DataFrame:
        """Select completions, in order."""
        return self.completions.filter(chosen.condition)

    def neighbours(
        self, key: CompletionKey, chosen: CompletionFilter
    ) -> tuple[CompletionKey | None, CompletionKey | None]:
        """The completions before and after one in the filtered list; None at an end."""
        keys = [None, *self.select(chosen).select(KEY).iter_rows(), None]
        at = keys.index(key) if key in keys else None
        return (None, None) if at is None else (keys[at - 1], keys[at + 1])

    def prompts(self, chosen: CompletionFilter) -> list[dict[str, Any]]:
        """All prompts, and how many completions are `written`, `judged` and `counted` (pass the filter)."""
        return prompt_counts(self.completions, chosen.verdict.condition).to_dicts()

    @property
    def judged(self) -> int:
        """The number of judged completions."""
        return judged_count(prompts_of(self.scores))

    @property
    def passed(self) -> int:
        """The number of completions that passed."""
        return passed_count(prompts_of(self.scores))

    @cached_property
    def scope(self) -> JudgingScope:
        """The completions that are to be judged."""
        return self.results.scope

    @property
    def coverage(self) -> Coverage:
        """How many completions were judged, are there, and were requested."""
        return self.scope.coverage(self.judged)

    @property
    def cut_off(self) -> CutOff:
        """The replies that were cut off."""
        return cut_off_replies(self.failures, self.scope)

    @cached_property
    def scores(self) -> tuple[TaskScore, ...]:
        """The scores by task and prompt."""
        return task_scores(self.results.table)

    @cached_property
    def pass_at_1(self) -> Estimate | None:
        """pass@1 over all prompts, with its interval over tasks; None if nothing was judged."""
        return overall(self.scores, 1) if self.scores else None

    @cached_property
    def failures(self) -> list[Failures]:
        """The classes of failures that occur, each with its kinds, the most frequent first."""
        if not self.judged:
            return []
        return [
            replace(
                cause,
                kinds=tuple(sorted((k for k in cause.kinds if k.count), key=lambda k: (-k.count, k.name))),
            )
            for cause in failures(tally_of(self.results.table))
            if cause.count
        ]
