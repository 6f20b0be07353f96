"""The list of mutants that are still right: what an operator changed, and why nobody can object to it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, TypeAlias

import yaml
from pydantic import BaseModel, ConfigDict, Field

from codebotler.badinput import YamlFile
from codebotler.world import Name, Text
from roboeval.mutation.mutants import Mutant
from roboeval.suites.load import Task

MOST = 0.15
"""The largest share of a task's mutants that may stand on the list."""

Reasons: TypeAlias = Mapping[tuple[str, str], str]
"""Why a mutant is right, by its operator and its diff."""


class EntryFile(BaseModel):
    """A mutant that is still right, as a list writes it.

    Args:
        operator: that made it.
        diff: what it changed, as `roboeval mutate` prints it.
        because: why it is right, in a sentence.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    operator: Name
    diff: Text
    because: Name


class ListFile(BaseModel):
    """The list of one task."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    mutants: Annotated[list[EntryFile], Field(min_length=1)]


def list_of(task: Task) -> Path:
    """Where the list of a task stands: `still-right/TASK.yaml` in the suite's folder."""
    return task.path.parents[1] / "still-right" / task.path.name


def reasons(task: Task) -> Reasons:
    """Which mutants of a task are still right, and why; none where there is no list.

    Args:
        task: the task.

    Raises:
        BadInput: the list is wrong, or names a mutant twice.
    """
    path = list_of(task)
    if not path.exists():
        return {}
    file = YamlFile.read(path)
    found: dict[tuple[str, str], str] = {}
    for number, entry in enumerate(file.validate(ListFile).mutants):
        key = entry.operator, _bare(entry.diff)
        if key in found:
            raise file.wrong("this mutant stands on the list already; take one out", "mutants", number)
        found[key] = entry.because.strip()
    return found


def key_of(mutant: Mutant) -> tuple[str, str]:
    """By what a list knows a mutant."""
    return mutant.operator, _bare(mutant.diff)


def _bare(diff: str) -> str:
    """A diff without the numbers of lines, which say nothing about right and wrong."""
    return "\n".join("@@" if line.startswith("@@") else line.rstrip() for line in diff.strip().splitlines())


def to_yaml(mutants: Iterable[Mutant]) -> str:
    """A list of mutants to fill in: each `because` waits for its reason."""
    entries = [{"operator": m.operator, "diff": _Block(m.diff), "because": ""} for m in mutants]
    return yaml.dump({"mutants": entries}, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=110)


class _Block(str):
    """A text that is written line by line."""

    __slots__ = ()


class _Dumper(yaml.SafeDumper):
    """Writes diffs line by line."""


_Dumper.add_representer(
    _Block, lambda dumper, text: dumper.represent_scalar("tag:yaml.org,2002:str", str(text), style="|")
)
