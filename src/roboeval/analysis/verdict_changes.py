"""What other checks change: completions with another verdict, and whether models change places."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any, Self

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from codebotler.badinput import BadInput
from codebotler.terminal import visible
from roboeval.analysis.cluster import Cluster, cluster_data, cluster_view, clusters, groups, trimmed
from roboeval.analysis.compare import Comparison, PromptScores, compared, comparison_data
from roboeval.analysis.metrics import score_by_prompt
from roboeval.analysis.statistics import ROUNDING
from roboeval.evaluation.completions import Key, how_many
from roboeval.evaluation.tables import RowData, key_of
from roboeval.suites.load import Suite


@dataclass(frozen=True)
class Judged:
    """A run as one suite judges it.

    Args:
        suite: that did.
        passed: the completions that pass.
        failed: the rows of the others, as `trimmed` leaves them.
        ablated: whether common sense only was required.
    """

    suite: Suite
    passed: frozenset[Key]
    failed: Mapping[Key, RowData]
    ablated: bool = False

    @classmethod
    def of(cls, rows: Iterable[RowData], suite: Suite, *, ablated: bool = False) -> Self:
        """Sort the rows of an evaluation, which are read once."""
        passed: set[Key] = set()
        failed: dict[Key, RowData] = {}
        for row in rows:
            if row["passed"]:
                passed.add(key_of(row))
            else:
                failed[key_of(row)] = trimmed(row)
        return cls(suite, frozenset(passed), failed, ablated)

    @property
    def keys(self) -> frozenset[Key]:
        """All that were judged."""
        return self.passed | self.failed.keys()


@dataclass(frozen=True)
class TaskReversals:
    """How many completions of a task pass under which of two suites."""

    task: str
    both: int
    first_only: int
    second_only: int
    neither: int


@dataclass(frozen=True)
class Reversals:
    """What a second suite changes for one run.

    Args:
        name: of the run.
        suites: the names of both.
        comparison: pass@1 under the second beside that under the first, prompt by prompt.
        tasks: in the order of the first suite.
        first_only: what passes under the first only, in groups, with what the second says against them.
        second_only: what passes under the second only, in groups, with what the first says against them.
        programs: how many different programs have another verdict.
        left_out: how many completions only one suite has judged.
    """

    name: str
    suites: tuple[str, str]
    comparison: Comparison
    tasks: tuple[TaskReversals, ...]
    first_only: tuple[Cluster, ...]
    second_only: tuple[Cluster, ...]
    programs: int
    left_out: int

    @property
    def completions(self) -> int:
        """How many both suites have judged."""
        return sum(task.both + task.first_only + task.second_only + task.neither for task in self.tasks)

    @property
    def pass_at_1(self) -> tuple[float, float]:
        """Under the first suite, and under the second."""
        return self.comparison.first, self.comparison.second


def reversals(name: str, first: Judged, second: Judged, programs: Mapping[Key, str]) -> Reversals:
    """Find the completions whose verdicts differ.

    Args:
        name: of the run.
        first: as one suite judges it.
        second: as the other does.
        programs: what was judged.

    Raises:
        BadInput: no completion was judged by both.
    """
    both = first.keys & second.keys
    if not both:
        raise BadInput("no completion was judged by both suites", file=name)
    lost, won = (first.passed & both) - second.passed, (second.passed & both) - first.passed
    return Reversals(
        name=name,
        suites=(first.suite.name, second.suite.name),
        comparison=compared(_pass_at_1(first, both), _pass_at_1(second, both)),
        tasks=tuple(_by_task(first, second, both)),
        first_only=tuple(_explained(lost, second, programs)),
        second_only=tuple(_explained(won, first, programs)),
        programs=len({(key[0], programs.get(key)) for key in lost | won}),
        left_out=len(first.keys | second.keys) - len(both),
    )


def _pass_at_1(judged: Judged, keys: frozenset[Key]) -> PromptScores:
    scores = score_by_prompt((task, prompt, (task, prompt, i) in judged.passed) for task, prompt, i in keys)
    return {(one.task, one.prompt): one.pass_at(1) for score in scores for one in score.prompts}


def _by_task(first: Judged, second: Judged, keys: frozenset[Key]) -> Iterator[TaskReversals]:
    counts = Counter((key[0], key in first.passed, key in second.passed) for key in keys)
    there = {task for task, *_ in counts}
    for task in dict.fromkeys([*first.suite.tasks, *sorted(there)]):
        if task in there:
            yield TaskReversals(
                task,
                both=counts[task, True, True],
                first_only=counts[task, True, False],
                second_only=counts[task, False, True],
                neither=counts[task, False, False],
            )


def _explained(keys: Iterable[Key], against: Judged, programs: Mapping[Key, str]) -> Iterator[Cluster]:
    together = groups((against.failed[key] for key in sorted(keys)), programs)
    return clusters(together, against.passed, programs, against.suite, ablated=against.ablated)


# --- the order of models


def place(name: str, scores: Mapping[str, float]) -> int:
    """The place of a run, from 1; those that pass equally often share one."""
    return 1 + sum(score > scores[name] + ROUNDING for score in scores.values())


@dataclass(frozen=True)
class Overtaking:
    """Two runs of which the suites say something else.

    Args:
        one: which is better under the second suite, or was under the first if it is not.
        other: which is not.
        first: by how much the one passes more often under the first suite.
        second: by how much it does under the second.
    """

    one: str
    other: str
    first: float
    second: float


def overtakings(found: Sequence[Reversals]) -> list[Overtaking]:
    """All pairs of runs that stand in another order under the second suite, or are tied under one only.

    Args:
        found: the runs, named apart. Where they are not judged on the same prompts, so are their means.
    """
    pairs = (_overtaking(one, other) for one, other in combinations(found, 2))
    return [told for told in pairs if _sign(told.first) != _sign(told.second)]


def _overtaking(one: Reversals, other: Reversals) -> Overtaking:
    first, second = (a - b for a, b in zip(one.pass_at_1, other.pass_at_1, strict=True))
    if (_sign(second), _sign(first)) < (0, 0):
        return Overtaking(other.name, one.name, -first, -second)
    return Overtaking(one.name, other.name, first, second)


def _sign(difference: float) -> int:
    return (difference > ROUNDING) - (difference < -ROUNDING)


# --- in sentences


def said(found: Reversals) -> str:
    """What changes for a run, in a sentence."""
    first, second = found.suites
    lost, won = (sum(len(one.members) for one in those) for those in (found.first_only, found.second_only))
    if not lost and not won:
        return f"{found.name}: {first} and {second} agree on all of {how_many(found.completions)}."
    passing = lost + sum(task.both for task in found.tasks)
    told = []
    if lost:
        told.append(f"turns away {lost:,} of the {how_many(passing)} that pass under {first}")
    if won:
        told.append(f"lets {won:,} pass that {first} turns away")
    kinds = f"{found.programs:,} different program{'s' * (found.programs != 1)}"
    return f"{found.name}: {second} {' and '.join(told)} ({kinds})."


def said_of_order(found: Sequence[Reversals]) -> list[str]:
    """Whether models change places, in sentences; nothing is said of one alone."""
    if len(found) < 2:  # noqa: PLR2004 - an order takes two
        return []
    first, second = found[0].suites
    changes = overtakings(found)
    if not changes:
        return [f"The order of the {len(found)} runs is the same under {second} as under {first}."]
    return [
        f"{pair.one} passes {HOW_OFTEN[_sign(pair.second)]} {pair.other} under {second}, "
        f"and {HOW_OFTEN[_sign(pair.first)]} it under {first}."
        for pair in changes
    ]


HOW_OFTEN = {1: "more often than", 0: "as often as", -1: "less often than"}


def said_of_prompts(found: Sequence[Reversals]) -> list[str]:
    """A word of warning where runs are about different prompts."""
    asked = {frozenset((task.task, task.prompts) for task in one.comparison.tasks) for one in found}
    return ["Not all runs are about the same prompts, on which their order may rest."][: len(asked) - 1]


COUNTS = ("both", "first_only", "second_only", "neither")


# --- for machines and people


def reversals_data(found: Sequence[Reversals]) -> dict[str, Any]:
    """What a second suite changes, as plain data."""
    first, second = found[0].suites
    return {
        "suites": [first, second],
        "runs": [_run_data(one, found) for one in found],
        "overtakings": [asdict(one) for one in overtakings(found)],
    }


def _run_data(one: Reversals, all_of_them: Sequence[Reversals]) -> dict[str, Any]:
    scores = [{run.name: run.pass_at_1[side] for run in all_of_them} for side in (0, 1)]
    compared = comparison_data(one.comparison, one.suites)
    return {
        "name": one.name,
        "completions": one.completions,
        "left_out": one.left_out,
        "programs": one.programs,
        "places": [place(one.name, of) for of in scores],
        **{name: compared[name] for name in ("first", "second", "difference", "interval", "p")},
        "tasks": [asdict(task) for task in one.tasks],
        "first_only": list(map(cluster_data, one.first_only)),
        "second_only": list(map(cluster_data, one.second_only)),
    }


def render(found: Sequence[Reversals], *, most: int) -> RenderableType:
    """What a second suite changes, as text and tables.

    Args:
        found: at least one.
        most: how many groups of programs are shown of each run and direction.
    """
    sentences = [*map(said, found), *said_of_order(found), *said_of_prompts(found)]
    parts: list[RenderableType] = [Text(visible(sentence), "bold") for sentence in sentences]
    parts += [Text(), _scores(found)]
    for one in found:
        parts += [Text(), _tasks(one)]
        first, second = one.suites
        parts += _groups(one.first_only, most, f"{first} only, and what {second} says")
        parts += _groups(one.second_only, most, f"{second} only, and what {first} says")
    return Group(*parts)


def _table(*heads: str) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for number, head in enumerate(heads):
        table.add_column(Text(head), justify="right" if number else "left", overflow="fold")
    return table


def _scores(found: Sequence[Reversals]) -> Table:
    first, second = found[0].suites
    table = _table("pass@1", first, second, "difference", "95% over prompts", "place")
    scores = [{one.name: one.pass_at_1[side] for one in found} for side in (0, 1)]
    for one in found:
        before, after = one.pass_at_1
        ends = one.comparison.over_prompts
        places = [place(one.name, of) for of in scores]
        table.add_row(
            Text(visible(one.name)),
            f"{before:.3f}",
            f"{after:.3f}",
            f"{after - before:+.3f}",
            f"{ends.low:+.3f} to {ends.high:+.3f}",
            " -> ".join(map(str, dict.fromkeys(places))),
        )
    return table


def _tasks(one: Reversals) -> Table:
    first, second = one.suites
    table = _table(visible(one.name), "both", f"{first} only", f"{second} only", "neither")
    for task in one.tasks:
        counts = asdict(task)
        table.add_row(Text(visible(task.task)), *(f"{counts[name]:,}" for name in COUNTS))
    return table


def _groups(every: Sequence[Cluster], most: int, what: str) -> list[RenderableType]:
    if not every:
        return []
    head = f"pass under {what}, in {len(every):,} group{'s' * (len(every) != 1)}:"
    left = len(every) - most
    more = [Text(f"{left:,} smaller groups; --groups shows more", "dim")] if left > 0 else []
    return [Text(), Text(head, "bold"), Text(), *map(cluster_view, every[:most]), *more]
