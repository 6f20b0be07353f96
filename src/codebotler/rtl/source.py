"""The source of an RTL formula, and errors that name the columns of mistakes in it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches

from codebotler.core.skills.kinds import INSIDE
from codebotler.core.skills.paper import SKILLS
from codebotler.core.text.words import brief

SKILL_KINDS = {skill.name: skill.recording.kind for skill in SKILLS.rows if skill.recording}
_MAX_SHOWN_LENGTH = 40


@dataclass(eq=False, repr=False)
class RtlSyntaxError(ValueError):
    """Raised for a string that is not a formula, with a message that gives the column and the reason.

    Args:
        column: the position, counted from 1.
        problem: what is wrong there.
    """

    column: int
    problem: str

    def __str__(self) -> str:
        return f"column {self.column}: {self.problem}"


class FormulaSource:
    """The text of one formula, with methods that return errors for mistakes in it."""

    def __init__(self, text: str) -> None:
        self.indent = len(text) - len(text.lstrip())
        self.text = re.sub(r"[\r\n\f]", " ", text).strip()
        self.bytes = self.text.encode(errors="replace")  # `ast` counts columns in bytes

    def unknown(self, at: ast.expr, what: str, name: str, known: Iterable[str]) -> RtlSyntaxError:
        """Return the error for an unknown `name`, with a hint. `what` is its kind, such as `test`."""
        close = [SKILL_KINDS[name]] if name in SKILL_KINDS else get_close_matches(name, known, 1)
        hint = f"did you mean {close[0]}?" if close else f"expected one of {', '.join(known)}"
        if name == INSIDE:
            hint = "only house rules can use it, since traces contain no poses"
        elif what in {"element", "state"} and not close:
            hint += ", or your own skill, if --skills or a suite gives its file"
        return self.error(at, f"unknown {what} {name}; {hint}")

    def expected(self, what: str, node: ast.expr) -> RtlSyntaxError:
        """Return the error for a part of the formula where `what`, such as `a string`, was expected."""
        found = brief(ast.get_source_segment(self.text, node) or "something else", _MAX_SHOWN_LENGTH)
        hint = "; put quotes around it" if "string" in what and isinstance(node, ast.Name) else ""
        return self.error(node.col_offset, f"expected {what}, found {found}{hint}")

    def error(self, at: ast.expr | int, problem: str) -> RtlSyntaxError:
        """Return the error for a problem `at` a syntax node, or at a byte offset in the formula."""
        if isinstance(at, ast.Attribute):
            at = (at.end_col_offset or 0) - len(at.attr.encode())
        offset = at if isinstance(at, int) else at.col_offset
        return RtlSyntaxError(self.indent + len(self.bytes[:offset].decode(errors="replace")) + 1, problem)
