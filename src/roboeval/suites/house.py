"""Reads house rules for evaluations, where a program that breaks a rule is stopped and fails."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from codebotler.checking.house_rules.file import read_rules
from codebotler.core.errors import UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.simulator.guard.house_rule import Rule


@dataclass(frozen=True)
class HouseRules:
    """The house rules in a file."""

    name: str  # the file name without its ending, used in evaluation names; empty for a suite's own rules
    rules: tuple[Rule, ...]  # the rules, in file order
    digest: str  # the file's SHA-256 in hexadecimal

    def __post_init__(self) -> None:
        for rule in self.rules:
            if rule.inside:
                raise UserError(
                    f'the rule "{rule.name}" uses "inside", which evaluations do not support; remove the rule'
                )

    @classmethod
    def read(
        cls, path: Path, skills: SkillTable = SKILLS, rooms: Sequence[str] = (), *, of_suite: bool = False
    ) -> HouseRules:
        """Read a rules file, validated against any given rooms. Raise UserError if it is invalid."""
        rules = read_rules(path, skills, rooms)
        if not of_suite and not re.fullmatch(r"[a-z0-9][a-z0-9-]*", path.stem):
            raise UserError(
                "is not a valid file name for rules; use lower-case letters, digits and dashes", file=path
            )
        return cls("" if of_suite else path.stem, rules, hashlib.sha256(path.read_bytes()).hexdigest())
