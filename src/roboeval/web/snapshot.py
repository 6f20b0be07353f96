"""Takes snapshots of a run: its judged and unjudged completions, and their counts."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any, Self
from urllib.parse import urlencode

import polars as pl
from fastapi import Query

from codebotler.core.cachedproperty import cached_property
from codebotler.models.no_program import NO_PROGRAM_SENTENCES
from roboeval.analysis.counting.counts import tally_of, task_scores
from roboeval.analysis.counting.summary import Failures, failures
from roboeval.analysis.metrics import Estimate, TaskScore, overall
from roboeval.evaluation.judging.failures import NO_PROGRAM_CLASS
from roboeval.evaluation.runs.completions import KEY, CompletionKey
from roboeval.evaluation.runs.results import Results
from roboeval.evaluation.runs.table import storable
from roboeval.suites.load import Suite
from roboeval.suites.task import plain_check

HAS_NO_PROGRAM = pl.col("failure_class").eq_missing(NO_PROGRAM_CLASS)
# The sign for the result of a program in a world is + if satisfied, - if not satisfied, and ! for an error.
WORLD_SIGN = (
    pl.when("satisfied")
    .then(pl.lit("+"))
    .when((pl.col("status") == "finished") | pl.col("error_kind").is_null())
    .then(pl.lit("-"))
    .otherwise(pl.lit("!"))
)
# The cause of a failure is a failed check, the limit that stopped the program, or an error.
ERROR_MESSAGE = pl.col("error_message")
FAILURE_CAUSE = (
    pl.when(HAS_NO_PROGRAM)
    .then(pl.col("failure_kind").replace(dict(NO_PROGRAM_SENTENCES)))
    .when(pl.col("failure_check").is_not_null())
    .then(pl.col("failure_check").map_elements(plain_check, return_dtype=pl.String))
    .when((pl.col("status") == "timeout") & ERROR_MESSAGE.str.contains(r"^\d"))
    .then(pl.format("stopped after {} (limit)", ERROR_MESSAGE))
    .otherwise(ERROR_MESSAGE)
)
INT64_LIMIT = 2**63


@dataclass(frozen=True)
class CompletionFilter:
    """Selects completions, such as the failed ones of one task. Pages and the API read it from their URL."""

    task: Annotated[str | None, Query(description="Only this task.")] = None
    prompt: Annotated[
        int | None, Query(ge=0, lt=INT64_LIMIT, description="Only this prompt, numbered from 0.")
    ] = None
    passed: Annotated[bool | None, Query(description="Only passed (true) or failed (false).")] = None
    failure_class: Annotated[str | None, Query(description="Only failures of this class.")] = None
    failure_kind: Annotated[str | None, Query(description="Only failures of this kind.")] = None

    @property
    def condition(self) -> pl.Expr:
        """The filter as a Polars condition on the rows of `Snapshot.completions`."""
        conditions = [pl.col(name) == value for name, value in asdict(self).items() if value is not None]
        return pl.all_horizontal(pl.lit(value=True), *conditions)

    @property
    def without_prompt(self) -> Self:
        """This filter without its task and prompt, so that it selects by verdict and failure only."""
        return replace(self, task=None, prompt=None)

    def query(self, evaluation: str | None) -> str:
        """Return the filter and `evaluation` as a URL query such as `?task=CountMen`, or "" if empty."""
        values = {"evaluation": evaluation, **asdict(self)}
        if self.passed is not None:
            values["passed"] = str(self.passed).lower()
        query = urlencode({name: v for name, v in values.items() if v is not None}, errors="replace")
        return f"?{query}" if query else ""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A run and one of its evaluations, with all completions and verdicts at the time of reading."""

    results: Results
    evaluations: tuple[str, ...]  # the names of all evaluations of the run
    is_written: bool  # whether a process is writing the run
    version: Hashable  # changes whenever a file of the run changes

    @property
    def name(self) -> str:
        """The name of the run's folder."""
        return self.results.run.path.name

    @property
    def suite(self) -> Suite | None:
        """The suite that judged the run, or None if it cannot be loaded, for example after its removal."""
        return self.results.suite

    @cached_property
    def models(self) -> list[str]:
        """The names of the models that wrote the completions, without those that were not recorded."""
        return sorted({c.model for c in self.results.completions.values() if c.model is not None})

    @cached_property
    def completions(self) -> pl.DataFrame:
        """One row for each completion in the order of the suite.

        `passed` is null if the completion was not judged. `worlds` has a sign for each world: + satisfied,
        - not satisfied, ! error. `why` is the check, limit or error that caused the failure.
        """
        signs = pl.when(HAS_NO_PROGRAM.first()).then(pl.lit("")).otherwise(WORLD_SIGN.str.join(""))
        judged = self.results.table.group_by(KEY, maintain_order=True).agg(
            pl.col("passed", "^failure_.*$").first(),
            signs.alias("worlds"),
            FAILURE_CAUSE.filter(pl.col("world_number") == pl.col("failure_world")).first().alias("why"),
        )
        keys = [(storable(task), prompt, index) for task, prompt, index in self.results.completions]
        schema = {"task": pl.String, "prompt": pl.Int64, "index": pl.Int64}
        written = pl.DataFrame(keys, schema=schema, orient="row")
        tasks = () if self.suite is None else tuple(self.suite.tasks)
        count = len(tasks)
        place = pl.col("task").replace_strict(tasks, range(count), default=count, return_dtype=pl.Int64)
        every = written.join(judged, on=KEY, how="left")
        return every.with_columns(pl.col("worlds", "why").fill_null("")).sort(place, *KEY)

    def row(self, name: str) -> dict[str, Any] | None:
        """Return the row of a completion by its name, such as `CountMen/0/12`, or None if there is none."""
        found = self.completions.filter(pl.format("{}/{}/{}", *KEY) == name)
        return found.row(0, named=True) if found.height else None

    def select(self, chosen: CompletionFilter) -> pl.DataFrame:
        """Return the rows of `completions` that a filter selects, in the same order."""
        return self.completions.filter(chosen.condition)

    def neighbours(
        self, key: CompletionKey, chosen: CompletionFilter
    ) -> tuple[CompletionKey | None, CompletionKey | None]:
        """Return the completions before and after `key` that `chosen` selects; None where there is none."""
        keys = [None, *self.select(chosen).select(KEY).iter_rows(), None]
        at = keys.index(key) if key in keys else None
        return (None, None) if at is None else (keys[at - 1], keys[at + 1])

    def prompts(self, chosen: CompletionFilter) -> list[dict[str, Any]]:
        """Count each prompt's completions: `written`, `judged`, and `counted` (selected by the filter).

        The filter's task and prompt are ignored. `share` is counted / judged, or None if none is judged.
        """
        judged = pl.col("judged")
        counts = self.completions.group_by("task", "prompt", maintain_order=True).agg(
            written=pl.len(), judged=pl.col("passed").count(), counted=chosen.without_prompt.condition.sum()
        )
        return counts.with_columns(share=pl.col("counted") / pl.when(judged > 0).then(judged)).to_dicts()

    @property
    def judged(self) -> int:
        """The number of judged completions."""
        return len(self.results.places)

    @property
    def passed(self) -> int:
        """The number of judged completions that passed."""
        return len(self.results.passed)

    @cached_property
    def scores(self) -> tuple[TaskScore, ...]:
        """The scores of each task and prompt."""
        return task_scores(self.results.table)

    @cached_property
    def pass_at_1(self) -> Estimate | None:
        """The mean pass@1 over all prompts with its interval over tasks, or None if nothing was judged."""
        return overall(self.scores, 1) if self.scores else None

    @cached_property
    def failures(self) -> dict[tuple[str, str | None], Failures]:
        """The classes of failures that occur, each followed by its kinds, most frequent first.

        A key is a class and a kind of failure. The kind is None for the whole class.
        """
        found: dict[tuple[str, str | None], Failures] = {}
        for cause in failures(tally_of(self.results.table)) if self.judged else ():
            if cause.count:
                found[cause.name, None] = cause
                for kind in sorted(cause.kinds, key=lambda kind: (-kind.count, kind.name)):
                    if kind.count:
                        found[cause.name, kind.name] = kind
        return found
