"""House rules of an evaluation: a program that breaks one is stopped and fails."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from codebotler.checking.rules import read_rules
from codebotler.core.errors import UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.simulator.house_rule import Rule


@dataclass(frozen=True)
class HouseRules:
    """The house rules of a file."""

    name: str  # the file's name without its ending, part of an evaluation's name; empty for rules of a suite
    rules: tuple[Rule, ...]  # the rules in the order of the file
    digest: str  # the SHA-256 of the file, in hexadecimal

    def __post_init__(self) -> None:
        for rule in self.rules:
            if rule.inside:
                raise UserError(
                    f'the rule "{rule.name}" uses "inside", which benchmarks do not support; remove it'
                )

    @classmethod
    def read(
        cls, path: Path, skills: SkillTable = SKILLS, rooms: Sequence[str] = (), *, of_suite: bool = False
    ) -> HouseRules:
        """Read a file of rules, for these rooms if they are known; raises UserError if it is not valid."""
        rules = read_rules(path, skills, rooms)
        if not of_suite and not re.fullmatch(r"[a-z0-9][a-z0-9-]*", path.stem):
            raise UserError(
                "is not a valid file name for rules; use lower-case letters, digits and dashes", file=path
            )
        return cls("" if of_suite else path.stem, rules, hashlib.sha256(path.read_bytes()).hexdigest())
