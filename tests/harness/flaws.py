"""The definite errors in the text of a program."""

from __future__ import annotations

from codebotler.core.program import Flaw, find_tree_flaws, parse_program
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable


def find_flaws(source: str, skills: SkillTable = SKILLS) -> tuple[Flaw, ...]:
    tree = parse_program(source, compiled=True)
    return (tree,) if isinstance(tree, Flaw) else find_tree_flaws(tree, source, skills)
