"""House rules beside a suite: programs are judged by what was asked, and stopped where they break a rule."""

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
    """The rules of a file.

    Args:
        name: by which evaluations with them are kept: the file's name without its ending. It is empty where
            a suite brings the rules itself.
        rules: in the order of the file.
        digest: the SHA-256 of the file, in hexadecimal.
    """

    name: str
    rules: tuple[Rule, ...]
    digest: str

    def __post_init__(self) -> None:
        for rule in self.rules:
            if rule.inside:
                raise UserError(f'the rule "{rule.name}" uses inside, which the benchmark cannot judge')

    @classmethod
    def of_suite(cls, path: Path, skills: SkillTable, rooms: Sequence[str]) -> HouseRules:
        """Read the rules that a suite with these rooms brings."""
        return cls("", read_rules(path, skills, rooms), hashlib.sha256(path.read_bytes()).hexdigest())

    @classmethod
    def read(cls, path: Path, skills: SkillTable = SKILLS, rooms: Sequence[str] = ()) -> HouseRules:
        """Read a file of rules, for these rooms if they are known; a UserError if it cannot be used."""
        rules = read_rules(path, skills, rooms)
        if not re.fullmatch(r"[a-z0-9][a-z0-9-]*", path.stem):
            raise UserError(
                "its name is used for files; write it in small letters, digits and dashes", file=path
            )
        return cls(path.stem, rules, hashlib.sha256(path.read_bytes()).hexdigest())
