"""Shows mutation scores as tables and diffs, and writes them to files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import yaml
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from codebotler.core.files import to_line, to_text, write_whole
from codebotler.core.terminal import visible
from roboeval.mutation.mutants import MUTATION_OPERATORS, Mutant
from roboeval.mutation.score import CHANGING_STATUSES, MutantStatus, MutationScore

DIFF_STYLES = {"+": "green", "-": "red"}
DESCRIPTIONS = {operator.name: operator.about for operator in MUTATION_OPERATORS}


def scores_view(scores: Sequence[MutationScore], suite: str) -> RenderableType:
    """Return a terminal table of the scores and counts of all tasks, headed by the name of the suite."""
    heads = "task", "worlds", "originals", "mutants", "killed", "equivalent", "survived", "score", "of all"
    table = Table(box=None, padding=(0, 2, 0, 0), show_edge=False)
    for number, head in enumerate((*heads, "same traces", "crashes")):
        table.add_column(head, justify="right" if number else "left", no_wrap=True)
    for score in scores:
        outcomes = MutantStatus.KILLED, MutantStatus.EQUIVALENT, MutantStatus.SURVIVED
        table.add_row(
            score.task,
            *(f"{n:,}" for n in (score.worlds, len(score.right), score.count(*CHANGING_STATUSES))),
            *(f"{score.count(status):,}" for status in outcomes),
            *("-" if share is None else f"{share:.3f}" for share in (score.score, score.score_of_all)),
            *(f"{score.count(status):,}" for status in (MutantStatus.SAME, MutantStatus.CRASHES)),
        )
    return Group(Text.assemble(("Mutation scores", "bold"), f" under the suite {suite}"), Text(), table)


def survivors_view(score: MutationScore) -> RenderableType:
    """Return a terminal view of a task's surviving mutants, each with its operator and diff."""
    parts: list[RenderableType] = []
    for number, mutant in enumerate(score.survivors, 1):
        origin = f'  {mutant.operator}, of "{visible(mutant.original.name)}"'
        head = Text.assemble((f"{score.task} {number}", "bold"), origin)
        lines = (Text(visible(line), DIFF_STYLES.get(line[:1], "")) for line in mutant.diff.splitlines())
        diff = Text("\n").join(lines)
        diff.rstrip()
        parts += [Text(), head, Text(DESCRIPTIONS[mutant.operator], "dim"), Padding(diff, (0, 0, 0, 2))]
    return Group(*parts)


def write_scores(scores: Sequence[MutationScore], folder: Path) -> None:
    """Write scores.json and, for each task, mutants/TASK.jsonl and survivors/TASK.yaml to a folder."""
    for score in scores:
        rows = b"".join(to_line(one.row()) for one in score.mutants)
        write_whole(folder / "mutants" / f"{score.task}.jsonl", rows)
        survivors = folder / "survivors" / f"{score.task}.yaml"
        if score.survivors:
            write_whole(survivors, to_yaml(score.survivors).encode(errors="backslashreplace"))
        else:
            survivors.unlink(missing_ok=True)
    write_whole(folder / "scores.json", to_text({"tasks": [score.data() for score in scores]}))


def to_yaml(mutants: Iterable[Mutant]) -> str:
    """Format mutants as YAML entries for `equivalent_mutants` in solutions/TASK.yaml, with empty reasons."""
    entries = [{"operator": one.operator, "diff": one.diff, "because": ""} for one in mutants]
    listed = {"equivalent_mutants": entries}
    return yaml.dump(listed, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=110)


class _Dumper(yaml.SafeDumper):
    """Writes multi-line strings as YAML blocks."""


def _text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style="|" if "\n" in text else None)


_Dumper.add_representer(str, _text)
