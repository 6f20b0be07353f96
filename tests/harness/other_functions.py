"""Skills that do something else in simulation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from codebotler.core.skills.table import SkillTable


def with_functions(skills: SkillTable, **does: Callable[..., Any]) -> SkillTable:
    """A copy of a table in which the named skills have other functions."""
    rows = (
        replace(row, does=does[row.name], is_idle=False) if row.name in does else row for row in skills.rows
    )
    return SkillTable(tuple(rows))
