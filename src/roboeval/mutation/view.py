"""Mutation scores for people: a table of tasks, a table of operators, and each survivor as a diff."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from codebotler.terminal import visible
from roboeval.mutation.operators import OPERATORS
from roboeval.mutation.scores import Score, Trial, by_operator
from roboeval.mutation.survival import CHANGED, Fate

STYLES = {"+": "green", "-": "red"}
ABOUT = {operator.name: operator.about for operator in OPERATORS}


def scores_view(scores: Sequence[Score], suite: str) -> RenderableType:
    """The score of each task.

    Args:
        scores: of tasks.
        suite: the name of the suite whose checks were tried.
    """
    heads = "task", "worlds", "originals", "mutants", "killed", "still right", "survived", "score", "of all"
    table = _table(*heads, "same traces", "crashes")
    for score in scores:
        table.add_row(
            score.task,
            *(f"{n:,}" for n in (score.worlds, len(score.right), score.count(*CHANGED))),
            *(f"{score.count(fate):,}" for fate in (Fate.KILLED, Fate.STILL_RIGHT, Fate.SURVIVED)),
            *map(_rate, (score.score, score.score_of_all)),
            *(f"{score.count(fate):,}" for fate in (Fate.SAME, Fate.CRASHES)),
        )
    title = Text.assemble(("Mutation scores", "bold"), f" under the suite {suite}")
    return Group(title, Text(), table)


def operators_view(scores: Sequence[Score]) -> RenderableType:
    """What became of the mutants of each operator that change behaviour."""
    table = _table("operator", "mutants", "killed", "survived")
    counts = by_operator(scores)
    for operator in OPERATORS:
        fates = counts.get(operator.name)
        if fates and sum(fates[fate] for fate in CHANGED):
            changing = sum(fates[fate] for fate in CHANGED)
            table.add_row(operator.name, *map(str, (changing, fates[Fate.KILLED], fates[Fate.SURVIVED])))
    return Group(Text("By operator", "bold"), Text(), table)


def survivors_view(score: Score) -> RenderableType:
    """The survivors of a task, each with what its operator does and its diff."""
    parts: list[RenderableType] = []
    for number, trial in enumerate(score.survivors, 1):
        parts += [Text(), _survivor(score.task, number, trial)]
    return Group(*parts)


def _survivor(task: str, number: int, trial: Trial) -> RenderableType:
    mutant = trial.mutant
    head = Text.assemble(
        (f"{task} {number}", "bold"), f'  {mutant.operator}, of "{visible(mutant.original.name)}"'
    )
    lines = Text()
    for line in mutant.diff.splitlines():
        lines.append(visible(line) + "\n", STYLES.get(line[:1], ""))
    lines.rstrip()
    return Group(head, Text(ABOUT[mutant.operator], "dim"), Padding(lines, (0, 0, 0, 2)))


def _table(*heads: str) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), show_edge=False)
    for number, head in enumerate(heads):
        table.add_column(head, justify="right" if number else "left", no_wrap=True)
    return table


def _rate(share: float | None) -> str:
    return "-" if share is None else f"{share:.3f}"
