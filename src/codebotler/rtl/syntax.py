"""From text to Formula: Python's own parser reads it, nothing is ever evaluated."""

from __future__ import annotations

import ast
import re
from dataclasses import replace
from difflib import get_close_matches
from typing import TYPE_CHECKING, get_args

from codebotler.core.skills import SKILLS
from codebotler.core.syntaxtree import parse_expression
from codebotler.rtl.formula import (
    ActAtFirst,
    ActAtSome,
    And,
    AtLeast,
    Count,
    CutName,
    EventPattern,
    Exists,
    Formula,
    Not,
    Or,
    Regex,
    Scope,
    Test,
    Without,
    Words,
)
from codebotler.rtl.text.claims import Claim, Number, Time, minutes

if TYPE_CHECKING:
    from collections.abc import Iterable

    from codebotler.core.skills import SkillTable
    from codebotler.rtl.formula import Cuts, Text

CUTS: dict[str, CutName] = {name: name for name in get_args(CutName)}
TESTS = {"Exists": 1, "ActAtFirst": 2, "ActAtSome": 2, "Count": 2, "AtLeast": 2}
"""How many arguments each test takes."""

CLAIMS = ("number", "othernumber", "time", "othertime", "affirms", "denies")
"""What a text may claim."""

ABOUT_QUESTIONS = ("mention", "answered")
"""Elements that are questions: by a text anywhere in them, and by what was answered."""

DEEPEST = 50
"""How deep a formula may be nested, and how many cuts may stand in a row; few enough for Python's stack."""

LARGEST = 1_000_000_000
"""The highest number of events that a formula may count to."""


class RtlSyntaxError(ValueError):
    """A text is no formula; the message is one sentence that says where and why.

    Args:
        column: where, counted from 1.
        problem: what is wrong there.
    """

    def __init__(self, column: int, problem: str) -> None:
        super().__init__(f"column {column}: {problem}")
        self.column = column
        self.problem = problem

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.column, self.problem), vars(self)


def parse(text: str, *, skills: SkillTable = SKILLS) -> Formula:
    """The formula that a text writes.

    Args:
        text: the formula; a line break counts as a space.
        skills: whose events are the elements of the language.

    Raises:
        RtlSyntaxError: the text is no formula.
    """
    return _Parser(text, skills).formula()


class _Parser:
    def __init__(self, text: str, skills: SkillTable) -> None:
        self.indent = len(text) - len(text.lstrip())
        self.text = re.sub(r"[\r\n\f]", " ", text).strip()
        self.bytes = self.text.encode(errors="replace")
        self.recordings = skills.recordings

    def formula(self) -> Formula:
        tree = self.tree()
        rest = self.bytes[tree.end_col_offset :]
        if b"#" in rest:
            raise self.error(
                tree.end_col_offset or 0, "RTL has no comments, yet one begins behind this place"
            )
        return self.constraint(tree, 0)

    def tree(self) -> ast.expr:
        if not self.text:
            raise RtlSyntaxError(1, "expected a formula, found nothing")
        try:
            return parse_expression(self.text)
        except SyntaxError as error:
            column = self.indent + max(error.offset or 1, 1)
            raise RtlSyntaxError(column, f"this cannot be read ({error.msg})") from None
        except UnicodeEncodeError as error:
            raise RtlSyntaxError(self.indent + error.start + 1, "this is no character") from None
        except (RecursionError, MemoryError):
            raise RtlSyntaxError(self.indent + 1, "this is nested too deeply") from None
        except ValueError as error:
            raise RtlSyntaxError(self.indent + 1, f"this cannot be read ({error})") from None

    def constraint(self, node: ast.expr, depth: int) -> Formula:
        self.limit(node, depth)
        match node:
            case ast.BoolOp(op, values):
                parts = tuple(self.constraint(value, depth + 1) for value in values)
                return And(parts) if isinstance(op, ast.And) else Or(parts)
            case ast.UnaryOp(ast.Not(), operand):
                return Not(self.constraint(operand, depth + 1))
            case ast.Call(ast.Attribute() as function, arguments, keywords):
                self.no_keywords(keywords)
                return self.test(function, arguments)
        raise self.expected('a test such as tr.Exists(goto("lobby"))', node)

    def test(self, function: ast.Attribute, arguments: list[ast.expr]) -> Test:
        name = function.attr
        if name in CUTS:
            raise self.error(
                function, f"{name} cuts the trace and must be followed by a test such as .Exists(...)"
            )
        if name not in TESTS:
            raise self.unknown(function, f"test {name}", name, [*TESTS, *CUTS])
        cuts = self.cuts(function.value)
        self.count_arguments(function, name, arguments, TESTS[name])
        match name:
            case "Exists":
                return Exists(self.element(arguments[0]), cuts)
            case "ActAtFirst":
                return ActAtFirst(self.without(arguments[0]).pattern, self.element(arguments[1]), cuts)
            case "ActAtSome":
                return ActAtSome(self.without(arguments[0]).pattern, self.element(arguments[1]), cuts)
            case "Count":
                return Count(self.element(arguments[0]), self.number(arguments[1]), cuts)
            case _:
                return AtLeast(self.element(arguments[0]), self.number(arguments[1]), cuts)

    def cuts(self, node: ast.expr) -> Cuts:
        cuts: list[Scope] = []
        while True:
            self.limit(node, len(cuts))
            match node:
                case ast.Name("tr"):
                    return tuple(reversed(cuts))
                case ast.Call(ast.Attribute(inner, name) as function, arguments, keywords):
                    if name in TESTS:
                        raise self.error(function, f"{name} is a test, so nothing can follow it")
                    if name not in CUTS:
                        raise self.unknown(function, f"cut {name}", name, CUTS)
                    self.no_keywords(keywords)
                    self.count_arguments(function, name, arguments, 1)
                    cuts.append(Scope(CUTS[name], self.element(arguments[0])))
                    node = inner
                case _:
                    raise self.expected("tr or a cut of it such as tr.AfterFirst(...)", node)

    def element(self, node: ast.expr) -> EventPattern:
        match node:
            case ast.Call(ast.Name("at"), arguments, keywords):
                self.no_keywords(keywords)
                self.count_arguments(node, "at", arguments, 2)
                inner = self.element(arguments[1])
                if inner.place is not None:
                    raise self.error(arguments[1], "at cannot stand in another at")
                return replace(inner, place=self.without(arguments[0]).pattern)
            case ast.Call(ast.Name(kind), arguments, keywords):
                asking = next((k for k, row in self.recordings.items() if row.options is not None), None)
                about = kind if kind in ABOUT_QUESTIONS and kind not in self.recordings else ""
                if (not about or asking is None) and kind not in self.recordings:
                    raise self.unknown(
                        node, f"element {kind}", kind, [*self.recordings, *ABOUT_QUESTIONS, "at"]
                    )
                self.no_keywords(keywords)
                asks = not about and self.recordings[kind].options is not None
                self.count_arguments(node, kind, arguments, 2 if asks else 1)
                texts = [self.matched(argument, 0) for argument in arguments]
                if about == "mention" and asking is not None:
                    return EventPattern(asking, texts[0], mention=True)
                if about and asking is not None:
                    return EventPattern(asking, Regex(".*"), answer=texts[0])
                return EventPattern(kind, texts[0], texts[1] if asks else None)
        raise self.expected('an element such as goto("lobby")', node)

    def matched(self, node: ast.expr, depth: int) -> Text:
        self.limit(node, depth)
        match node:
            case ast.Constant(str()):
                return Regex(self.regex(node))
            case ast.Call(ast.Name("words"), arguments, keywords):
                self.no_keywords(keywords)
                if not arguments:
                    raise self.error(node, "words needs at least one text")
                return Words(tuple(self.matched(argument, depth + 1) for argument in arguments))
            case ast.Call(ast.Name("without"), arguments, keywords):
                self.no_keywords(keywords)
                self.count_arguments(node, "without", arguments, 1)
                return self.without(arguments[0])
            case ast.Call(ast.Name(name), arguments, keywords) if name in CLAIMS:
                self.no_keywords(keywords)
                return self.claim(node, name, arguments)
            case ast.Call(ast.Name(name)):
                raise self.unknown(node, f"text helper {name}", name, ["words", "without", *CLAIMS])
        raise self.expected("a string, words(...) or without(...)", node)

    def claim(self, node: ast.expr, name: str, arguments: list[ast.expr]) -> Text:
        match name:
            case "affirms" | "denies":
                self.count_arguments(node, name, arguments, 1)
                return Claim(self.without(arguments[0]).pattern, name == "denies")
            case "time" | "othertime":
                self.count_arguments(node, name, arguments, 2)
                start, end = (self.time(argument) for argument in arguments)
                return Time(start, end, name == "othertime")
        if len(arguments) < 2:  # noqa: PLR2004 - the number and the thing
            raise self.error(node, f"{name} takes a number, a thing and perhaps other things")
        number, (thing, *others) = (
            self.number(arguments[0]),
            [self.without(one).pattern for one in arguments[1:]],
        )
        return Number(number, thing, tuple(others), name == "othernumber")

    def time(self, node: ast.expr) -> str:
        text = self.regex(node)
        try:
            minutes(text)
        except ValueError as error:
            raise self.error(node, str(error)) from None
        return text

    def without(self, node: ast.expr) -> Without:
        text = Without(self.regex(node))
        try:
            _ = text.compiled
        except (re.error, RecursionError) as error:
            raise self.error(node, f"this regex cannot be searched as a whole word ({error})") from None
        return text

    def regex(self, node: ast.expr) -> str:
        match node:
            case ast.Constant(str(pattern)):
                if "\b" in pattern:
                    raise self.error(
                        node, 'this string holds a backspace; write r"..." so that \\b is the edge of a word'
                    )
                try:
                    _ = Regex(pattern).compiled
                except (re.error, RecursionError, OverflowError) as error:
                    raise self.error(node, f"this is no valid regex ({error})") from None
                return pattern
        raise self.expected("a string", node)

    def number(self, node: ast.expr) -> int:
        match node:
            case ast.Constant(value) if type(value) is int:
                if value > LARGEST:
                    raise self.error(node, f"expected a number of at most {LARGEST}")
                return value
            case ast.UnaryOp(ast.USub(), ast.Constant(int())):
                raise self.error(node, "a number of events cannot be negative")
        raise self.expected("a whole number such as 3", node)

    def count_arguments(self, at: ast.expr, name: str, arguments: list[ast.expr], wanted: int) -> None:
        if len(arguments) != wanted:
            plural = "" if wanted == 1 else "s"
            raise self.error(at, f"{name} takes {wanted} argument{plural}, not {len(arguments)}")

    def no_keywords(self, keywords: list[ast.keyword]) -> None:
        for keyword in keywords:
            raise self.error(keyword.col_offset, "arguments have no names in RTL")

    def limit(self, node: ast.expr, depth: int) -> None:
        if depth > DEEPEST:
            raise self.error(node, f"this is nested more than {DEEPEST} deep")

    def unknown(self, at: ast.expr, what: str, name: str, known: Iterable[str]) -> RtlSyntaxError:
        close = get_close_matches(name, known, 1)
        hint = f"did you mean {close[0]}?" if close else f"expected one of {', '.join(known)}"
        return self.error(at, f"unknown {what}; {hint}")

    def expected(self, what: str, node: ast.expr) -> RtlSyntaxError:
        found = ast.get_source_segment(self.text, node) or "something else"
        found = found if len(found) <= _SHOWN else found[: _SHOWN - 3] + "..."
        return self.error(node.col_offset, f"expected {what}, found {found}")

    def error(self, at: ast.expr | int, problem: str) -> RtlSyntaxError:
        """What is wrong, at a node or at a position in bytes, which is how `ast` counts."""
        if isinstance(at, ast.Attribute):
            at = (at.end_col_offset or 0) - len(at.attr.encode())
        offset = at if isinstance(at, int) else at.col_offset
        characters = len(self.bytes[:offset].decode(errors="replace"))
        return RtlSyntaxError(self.indent + characters + 1, problem)


_SHOWN = 40
