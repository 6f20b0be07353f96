"""Parse RTL formulas as Python expressions without running them."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import get_args

from codebotler.core.program import parse_expression
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.skills.values import TRUTH_TYPE, ValueType, as_text
from codebotler.core.text.unicode import compose
from codebotler.rtl import formulas
from codebotler.rtl.pattern import compile_regex, whole_word
from codebotler.rtl.source import SKILL_KINDS, FormulaSource, RtlSyntaxError
from codebotler.rtl.text.claims import Claim, Number, Time, minutes

SCOPE_NAMES: dict[str, formulas.ScopeName] = {name: name for name in get_args(formulas.ScopeName)}
TESTS: Mapping[str, Callable[..., formulas.Test]] = {
    kind.__name__: kind for kind in (*get_args(formulas.PresenceTest), formulas.Count, formulas.AtLeast)
}
TEXT_WORDS = ("words", "without", "number", "othernumber", "time", "othertime", "affirms", "denies")
ANSWERED = "answered"
QUESTIONS = ("mention", ANSWERED)
LOOK_RESULTS = {"found": True, "missed": False}
LAST_LOOKS = {"last_found": True, "last_missed": False}
WRAPPED_FIELDS = {"at": "place", "holding": "holding", "to": "to", "returned": "found"}
"""The words for further conditions on an event, each with the field of `EventPattern` that it sets."""
NOT_STATES = frozenset({*TESTS, *SCOPE_NAMES, *QUESTIONS, *LOOK_RESULTS, *WRAPPED_FIELDS, *SKILL_KINDS})

SET_TAG = re.compile(r"\{([^\W\d_][\w ]*)\}")  # a set in a string, such as {metal}; {3} is a repetition
THING_NAME = re.compile(r"\^?[\w ',;:!%@&/-]+\$?")
SPECIAL_CHARACTERS = re.compile(r"[][\\.^$*+?{}|()]")

NO_MEANINGS: Mapping[str, str] = MappingProxyType({})

MAX_FORMULA_DEPTH = 50  # low enough for Python's stack during every evaluation


def parse(
    text: str,
    *,
    skills: SkillTable = SKILLS,
    means: Mapping[str, str] = NO_MEANINGS,
    sets: Mapping[str, Sequence[str]] | None = None,
) -> formulas.Formula:
    """Parse a formula, such as `tr.Exists(goto("lobby"))`.

    Args:
        text: the formula; a line break counts as a space.
        skills: the skills whose events the formula may name.
        means: words for explanations, by kind of event: what its texts mean, such as `that nobody is coming`
            for `say`. Answered questions have the key `answered`.
        sets: the names in each set, for texts such as `{stoves}`; None if braces do not mean sets.

    Raises:
        RtlSyntaxError: the text is not a formula.
    """
    return _Parser(compose(text), skills, means, sets).formula()


class _Parser(FormulaSource):
    def __init__(
        self,
        text: str,
        skills: SkillTable,
        means: Mapping[str, str],
        sets: Mapping[str, Sequence[str]] | None,
    ) -> None:
        super().__init__(text)
        self.means, self.sets = means, sets
        self.recordings = skills.recordings
        self.skill_of = {s.recording.kind: s for s in skills.rows if s.recording}
        self.types = {kind: {p.name: p.type for p in s.parameters} for kind, s in self.skill_of.items()}
        self.question = next((kind for kind, row in self.recordings.items() if row.options is not None), None)
        looks = (kind for kind, row in self.recordings.items() if row.names == "object or person")
        self.look = next(looks, None)
        self.states = {row.sets for row in self.recordings.values() if row.sets}

    def formula(self) -> formulas.Formula:
        if not self.text:
            raise RtlSyntaxError(1, 'expected a formula such as tr.Exists(goto("lobby")), found nothing')
        try:
            tree = parse_expression(self.text)
        except SyntaxError as error:
            column = self.indent + max(error.offset or 1, 1)
            raise RtlSyntaxError(column, f"the formula cannot be read ({error.msg})") from None
        except (RecursionError, MemoryError):
            raise RtlSyntaxError(self.indent + 1, "the formula is nested too deeply; simplify it") from None
        except ValueError as error:
            raise RtlSyntaxError(self.indent + 1, f"the formula cannot be read ({error})") from None
        end = tree.end_col_offset or 0
        if b"#" in self.bytes[end:]:  # a comment would hide all following lines
            raise self.error(end, "RTL has no comments; remove the one after the formula")
        return self.constraint(tree, 0)

    def constraint(self, node: ast.expr, depth: int) -> formulas.Formula:
        if depth > MAX_FORMULA_DEPTH:
            raise self.error(node, f"the formula is nested more than {MAX_FORMULA_DEPTH} levels deep")
        match node:
            case ast.BoolOp(op, values):
                parts = tuple(self.constraint(value, depth + 1) for value in values)
                return formulas.And(parts) if isinstance(op, ast.And) else formulas.Or(parts)
            case ast.UnaryOp(ast.Not(), operand):
                return formulas.Not(self.constraint(operand, depth + 1))
            case ast.Call(ast.Attribute() as function):
                return self.test(node, function)
            case ast.Call(ast.Name(name)) if name in LAST_LOOKS and self.look is not None:
                return self.last_look(name, node)
            case ast.Call(ast.Name(name)) if name in self.states:
                return self.state(name, node)
            case ast.Call(ast.Name(name)) if name not in {*self.recordings, *NOT_STATES}:
                raise self.unknown(node, "state", name, [*LAST_LOOKS, *sorted(self.states)])
        raise self.expected('a test such as tr.Exists(goto("lobby"))', node)

    def last_look(self, name: str, node: ast.Call) -> formulas.Formula:
        """Parse `last_found(...)` or `last_missed(...)`, which test the last look for a thing."""
        (thing,) = self.arguments(node, node, name, 1)
        text, found = self.matched(thing), LAST_LOOKS[name]
        wanted, opposite = (formulas.EventPattern(self.look or "", text, found=f) for f in (found, not found))
        return formulas.Exists(wanted, (formulas.Scope("AfterLast", opposite),))

    def state(self, name: str, node: ast.Call) -> formulas.Formula:
        """Parse a state test such as `on("stove")` or, for any thing in a set, `on("{stoves}")`."""
        (thing,) = self.arguments(node, node, name, 1)
        things = [thing]
        match thing:
            case ast.Constant(str(text)) if self.sets is not None and (tag := SET_TAG.fullmatch(text)):
                names = map(_escaped, self.names_in(tag[1], thing))
                things = [ast.copy_location(ast.Constant(each), thing) for each in names]
            case ast.Constant(str(text)) if not THING_NAME.fullmatch(text):
                raise self.expected(f'a string that names one thing, as in {name}("stove")', thing)
            case ast.Call():
                raise self.expected(f'a string that names one thing, as in {name}("stove")', thing)
        return _joined(formulas.Or, [self.is_in_state(name, each) for each in things])

    def is_in_state(self, name: str, thing: ast.expr) -> formulas.Formula:
        """Return a formula that holds while a thing is in a state: set by an event, and not cleared since."""
        rows = self.recordings.items()
        setting = [self.event_of(kind, thing) for kind, row in rows if row.sets == name]
        clearing = [self.event_of(kind, thing) for kind, row in rows if row.clears == name]
        scopes: list[tuple[formulas.Scope, ...]] = [(formulas.Scope("AfterLast", one),) for one in clearing]
        ways = [[formulas.Exists(one, scope) for one in setting] for scope in scopes or [()]]
        return _joined(formulas.And, [_joined(formulas.Or, each) for each in ways])

    def event_of(self, kind: str, thing: ast.expr) -> formulas.EventPattern:
        text = self.value(thing, self.types[kind][self.recordings[kind].text])
        return formulas.EventPattern(kind, text, means=self.means.get(kind))

    def test(self, node: ast.Call, function: ast.Attribute) -> formulas.Test:
        name = function.attr
        if name in SCOPE_NAMES:
            problem = f"{name} is a scope and must be followed by a test such as .Exists(...)"
            raise self.error(function, problem)
        if name not in TESTS:
            raise self.unknown(function, "test", name, [*TESTS, *SCOPE_NAMES])
        kind, scopes = TESTS[name], self.scopes(function.value)
        if name in {"Exists", "Last"}:
            (element,) = self.arguments(node, function, name, 1)
            return kind(self.element(element), scopes)
        one, other = self.arguments(node, function, name, 2)
        if name.startswith("ActAt"):
            return kind(self.word(one), self.element(other), scopes)
        return kind(self.element(one), self.number(other), scopes)

    def scopes(self, node: ast.expr) -> tuple[formulas.Scope, ...]:
        scopes: list[formulas.Scope] = []
        while True:
            match node:
                case ast.Name("tr"):
                    return tuple(reversed(scopes))
                case ast.Call(ast.Attribute(inner, name) as function):
                    if name in TESTS:
                        raise self.error(function, f"{name} is a test, so nothing can follow it")
                    if name not in SCOPE_NAMES:
                        raise self.unknown(function, "scope", name, SCOPE_NAMES)
                    (element,) = self.arguments(node, function, name, 1)
                    scopes.append(formulas.Scope(SCOPE_NAMES[name], self.element(element)))
                    node = inner
                case _:
                    raise self.expected("tr or a scope such as tr.AfterFirst(...)", node)

    def element(self, node: ast.expr) -> formulas.EventPattern:
        element = self.bare_element(node)
        key = element.kind if element.answer is None else ANSWERED
        return replace(element, means=self.means.get(key))

    def bare_element(self, node: ast.expr) -> formulas.EventPattern:
        match node:
            case ast.Call(ast.Name(name)) if name in WRAPPED_FIELDS:
                return self.around(name, node)
            case ast.Call(ast.Name(kind)) if kind in self.recordings:
                if self.recordings[kind].options is None:
                    return self.plain_element(kind, node)
                text, options = self.arguments(node, node, kind, 2)
                return formulas.EventPattern(kind, self.matched(text), self.matched(options))
            case ast.Call(ast.Name(kind)) if kind in QUESTIONS and self.question is not None:
                (text,) = self.arguments(node, node, kind, 1)
                if kind == "mention":
                    return formulas.EventPattern(self.question, self.matched(text), mention=True)
                return formulas.EventPattern(self.question, formulas.Regex(".*"), answer=self.matched(text))
            case ast.Call(ast.Name(kind)) if kind in LOOK_RESULTS and self.look is not None:
                (text,) = self.arguments(node, node, kind, 1)
                return formulas.EventPattern(self.look, self.matched(text), found=LOOK_RESULTS[kind])
            case ast.Call(ast.Name(kind)):
                known = [*self.recordings, *QUESTIONS, *LOOK_RESULTS, *WRAPPED_FIELDS]
                raise self.unknown(node, "element", kind, known)
        raise self.expected('an element such as goto("lobby")', node)

    def plain_element(self, kind: str, node: ast.Call) -> formulas.EventPattern:
        """Parse an event without options, with its text and further arguments."""
        recording = self.recordings[kind]
        if not recording.text:
            self.arguments(node, node, kind, 0)
            return formulas.EventPattern(kind, formulas.Regex(".*"), has_text=False)
        if not recording.more:
            (text,) = self.arguments(node, node, kind, 1)
            return formulas.EventPattern(kind, self.value(text, self.types[kind][recording.text]))
        given = self.arguments(node, node, kind)
        most = 1 + len(recording.more)
        if not 1 <= len(given) <= most:
            raise self.error(node, f"{kind} takes 1 to {most} arguments, not {len(given)}")
        types = [self.types[kind][name] for name in (recording.text, *recording.more)]
        first, *more = map(self.value, given, types)
        return formulas.EventPattern(kind, first, more=tuple(more))

    def value(self, node: ast.expr, wanted: ValueType) -> formulas.TextPattern:
        """Parse a pattern for an argument, where numbers and booleans may be literals."""
        if wanted.base == "str":
            text = self.matched(node)
            if wanted.choices and not any(text.matches(as_text(one)) for one in wanted.choices):
                raise self.error(node, f"the text is not one of {', '.join(map(as_text, wanted.choices))}")
            return text
        is_constant = isinstance(node, ast.Constant) and isinstance(node.value, bool | str)
        if wanted.base == "bool" and not is_constant:
            raise self.expected("True or False", node)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.isalpha():
            raise self.expected(f"{wanted.in_words}, or a regex for it", node)
        match node:
            case ast.Constant(int() | float() as value) | ast.UnaryOp(
                ast.USub(), ast.Constant(int() | float() as value)
            ):
                is_negative = isinstance(node, ast.UnaryOp)
                return formulas.Regex(f"^{re.escape(as_text(-value if is_negative else value))}$")
        return self.matched(node)

    def around(self, name: str, node: ast.Call) -> formulas.EventPattern:
        what, inner = self.arguments(node, node, name, 2)
        element, field = self.element(inner), WRAPPED_FIELDS[name]
        if getattr(element, field) is not None:
            raise self.error(inner, f"{name} cannot be nested in another {name}")
        if name == "to" and element.kind != self.question:
            raise self.error(inner, "to(...) needs a question: ask(...), mention(...) or answered(...)")
        if name == "returned" and self.skill_of[element.kind].returns != TRUTH_TYPE:
            problem = f"returned needs a skill that returns True or False; {element.kind} does not"
            raise self.error(inner, problem)
        read: Callable[[ast.expr], object] = {"at": self.word, "returned": self.truth}.get(name, self.matched)
        return replace(element, **{field: read(what)})  # type: ignore[arg-type]  # as `WRAPPED_FIELDS` says

    def truth(self, node: ast.expr) -> bool:
        match node:
            case ast.Constant(bool(value)):
                return value
        raise self.expected("True or False", node)

    def matched(self, node: ast.expr) -> formulas.TextPattern:
        match node:
            case ast.Constant(str()):
                return formulas.Regex(self.regex(node))
            case ast.Call(ast.Name(name)) if name not in TEXT_WORDS:
                raise self.unknown(node, "text helper", name, TEXT_WORDS)
            case ast.Call(ast.Name("words")):
                arguments = self.arguments(node, node, "words")
                if not arguments:
                    raise self.error(node, 'words needs at least one text, as in words("tea")')
                return formulas.Words(tuple(map(self.matched, arguments)))
            case ast.Call(ast.Name(name)) if name.endswith("number"):
                arguments = self.arguments(node, node, name)
                if len(arguments) < 2:  # noqa: PLR2004 - the number and the thing
                    usage = f'a number and the thing to count, as in {name}(2, "mug")'
                    raise self.error(node, f"{name} takes {usage}")
                number, (thing, *others) = self.number(arguments[0]), map(self.word, arguments[1:])
                return Number(number, thing, tuple(others), name == "othernumber")
            case ast.Call(ast.Name(name)) if name.endswith("time"):
                start, end = map(self.time, self.arguments(node, node, name, 2))
                return Time(start, end, name == "othertime")
            case ast.Call(ast.Name(name)):
                (argument,) = self.arguments(node, node, name, 1)
                word = self.word(argument)
                return formulas.Without(word) if name == "without" else Claim(word, name == "denies")
        raise self.expected("a string, words(...) or without(...)", node)

    def time(self, node: ast.expr) -> str:
        text = self.regex(node)
        try:
            minutes(text)
        except ValueError as error:
            raise self.error(node, str(error)) from None
        return text

    def word(self, node: ast.expr) -> str:
        pattern = self.regex(node)
        self.check_regex(node, pattern, whole_word, "the regex cannot be searched as a whole word")
        return pattern

    def regex(self, node: ast.expr) -> str:
        match node:
            case ast.Constant(str(pattern)):
                if "\b" in pattern:
                    mend = 'write r"..." so that \\b is a word boundary'
                    raise self.error(node, f"the string contains a backspace; {mend}")
                if self.sets is not None:
                    pattern = SET_TAG.sub(lambda tag: self.alternation(tag, node), pattern)
                self.check_regex(node, pattern, compile_regex, "the string is not a valid regex")
                return pattern
        raise self.expected("a string", node)

    def alternation(self, tag: re.Match[str], node: ast.expr) -> str:
        names = "|".join(map(_escaped, self.names_in(tag[1], node)))
        return names if tag[0] == tag.string else f"(?:{names})"

    def names_in(self, name: str, node: ast.expr) -> Sequence[str]:
        sets = self.sets or {}
        if name not in sets:
            raise self.error(node, no_set(name, sets))
        return sets[name]

    def check_regex(self, at: ast.expr, pattern: str, compiled: Callable[[str], object], wrong: str) -> None:
        try:
            compiled(pattern)
        except (re.error, RecursionError, OverflowError) as error:
            raise self.error(at, f"{wrong} ({error})") from None

    def number(self, node: ast.expr) -> int:
        match node:
            case ast.Constant(value) if type(value) is int:
                return value
        raise self.expected("a whole number such as 3", node)

    def arguments(self, call: ast.Call, at: ast.expr, name: str, wanted: int | None = None) -> list[ast.expr]:
        for keyword in call.keywords:
            raise self.error(keyword.col_offset, f"RTL has no keyword arguments; remove `{keyword.arg}=`")
        found = len(call.args)
        if wanted is not None and found != wanted and name == self.question:
            hint = f'{name} takes a question and an option, as in {name}("tea", ".*")'
            raise self.error(at, f"{hint}; use mention(...) for a string that may be in either")
        if wanted is not None and found != wanted:
            takes = f"{wanted or 'no'} argument{'s' * (wanted > 1)}"
            raise self.error(at, f"{name} takes {takes}, not {found}")
        return call.args


def no_set(name: str, sets: Iterable[str]) -> str:
    """Return the message for an unknown set of names, with a list of the known sets."""
    known = ", ".join(sets)
    return f"there is no set {name}; " + (f"the sets are {known}" if known else 'list its names under "sets"')


def _escaped(name: str) -> str:
    return SPECIAL_CHARACTERS.sub(r"\\\g<0>", name)


def _joined(kind: type[formulas.And | formulas.Or], parts: Sequence[formulas.Formula]) -> formulas.Formula:
    return parts[0] if len(parts) == 1 else kind(tuple(parts))
