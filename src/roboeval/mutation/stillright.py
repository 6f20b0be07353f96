"""The list of mutants that are still right: what an operator changed, and why nobody can object to it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TypeAlias

import yaml

from roboeval.mutation.mutants import Mutant
from roboeval.suites.solutions import bare_diff

MOST = 0.15
"""The largest share of a task's mutants that may stand on the list."""

Reasons: TypeAlias = Mapping[tuple[str, str], str]
"""Why a mutant is right, by its operator and its diff."""


def key_of(mutant: Mutant) -> tuple[str, str]:
    """By what a list knows a mutant."""
    return mutant.operator, bare_diff(mutant.diff)


def to_yaml(mutants: Iterable[Mutant]) -> str:
    """A list of mutants to fill in: each `because` waits for its reason."""
    entries = [{"operator": m.operator, "diff": _Block(m.diff), "because": ""} for m in mutants]
    return yaml.dump(
        {"equivalent_mutants": entries}, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=110
    )


class _Block(str):
    """A text that is written line by line."""

    __slots__ = ()


class _Dumper(yaml.SafeDumper):
    """Writes diffs line by line."""


_Dumper.add_representer(
    _Block, lambda dumper, text: dumper.represent_scalar("tag:yaml.org,2002:str", str(text), style="|")
)
