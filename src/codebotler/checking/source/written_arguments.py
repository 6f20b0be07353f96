"""Find the texts that a program gives to its skills, by reading its source without running it."""

from __future__ import annotations

import ast
import re
import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import TypeAlias

from codebotler.checking.source.possible_values import PossibleValues
from codebotler.core.program import all_bound_names, nodes, parse_leniently
from codebotler.core.skills.table import SkillTable
from codebotler.core.skills.values import as_text
from codebotler.core.text.text_template import ANY_TEXT, TextTemplate
from codebotler.simulator.process.isolated_call import IsolatedCallError, isolated

MAX_TEMPLATES, MAX_COMBINATIONS = 50, 8  # more become any text
FIELD = re.compile(r"%[-+ #0]*\d*(?:\.\d+)?[a-zA-Z]|\{[^{}]*\}")
"""A gap in a text that is formatted with `%` or `format`, where any text may be."""

ESCAPED = re.compile(r"%%|\{\{|\}\}|%\(|%[^a-zA-Z]*\*")
PURE_MODULES = frozenset(
    {"collections", "dataclasses", "enum", "functools", "itertools", "json", "math", "operator", "re"}
    | {"string", "typing"}
)
"""Modules without a clock. A program that imports another module may depend on the time of day."""

CLOCKS = sys.stdlib_module_names - PURE_MODULES - {"copy"} | {"modules", "attrgetter", "methodcaller", "*"}
"""Attributes that may lead to a clock, such as `os`. Not `copy`, since lists have a `copy` as well."""

TRICKS = frozenset(
    {"eval", "exec", "globals", "locals", "vars", "getattr", "__builtins__", "__import__", "sys"}
)
Templates: TypeAlias = frozenset[TextTemplate]
UNKNOWN: Templates = frozenset({ANY_TEXT})
NOTHING: Templates = frozenset()


@dataclass(frozen=True)
class WrittenArguments:
    """The texts that a program passes to its skills, as far as its source shows them.

    Args:
        skills: `skills["go_to"]["location"]` has the texts of this argument of `go_to`, and `ANY_TEXT` if
            there may be others.
        reads_clock: whether the program may depend on the time of day or on random numbers.
    """

    skills: Mapping[str, Mapping[str, Sequence[TextTemplate]]]
    reads_clock: bool


def read_arguments(program: str, skills: SkillTable) -> WrittenArguments:
    """Return the texts that a program passes to its skills, or any text if its source cannot be read."""
    parameters = [(row.name, [one.name for one in row.parameters]) for row in skills.rows]
    try:
        found, reads_clock = _read(program, parameters)
    except IsolatedCallError:
        anything = [[*ANY_TEXT.parts]]
        found, reads_clock = [(skill, name, anything) for skill, names in parameters for name in names], True
    texts: defaultdict[str, dict[str, Sequence[TextTemplate]]] = defaultdict(dict)
    for skill, name, parts in found:
        texts[skill][name] = [TextTemplate(tuple(one)) for one in parts]
    return WrittenArguments(texts, reads_clock)


_Found: TypeAlias = list[tuple[str, str, list[list[str]]]]


@isolated("say('a')", [("say", ["message"])])
def _read(program: str, parameters: list[tuple[str, list[str]]]) -> tuple[_Found, bool]:
    tree = parse_leniently(program)
    named = {node.id for node in nodes(tree) if isinstance(node, ast.Name)}
    try:
        bound = all_bound_names(tree)
        values = _Texts(tree)
        given = values.given({name: names for name, names in parameters if name not in bound})
    except RecursionError:
        given, named = {}, set(TRICKS)
    if named & TRICKS:
        given |= {(skill, name): UNKNOWN for skill, names in parameters for name in names}
    found = [(*key, sorted([*one.parts] for one in templates)) for key, templates in given.items()]
    return found, bool(named & TRICKS) or _reads_clock(tree)


def _reads_clock(tree: ast.Module) -> bool:
    """Return whether a program uses a clock or random numbers, rather than only waiting."""
    waits = {node.value for node in nodes(tree) if isinstance(node, ast.Attribute) and node.attr == "sleep"}
    return any(_is_clock(node) for node in nodes(tree) if node not in waits)


def _is_clock(node: ast.AST) -> bool:
    match node:
        case ast.alias("time", None):
            pass
        case ast.Name(name):
            is_read = isinstance(node.ctx, ast.Load)
            return (name == "time" and is_read) or (name.startswith("__") and name != "__name__")
        case ast.Attribute(_, name) | ast.alias(name):
            return name in CLOCKS or (name.startswith("_") and name != "__name__")
        case ast.Import(names):
            return not {one.name for one in names} <= PURE_MODULES | {"time"}
        case ast.ImportFrom("time", names):
            return any(one.name != "sleep" for one in names)
        case ast.ImportFrom(module):
            return module not in PURE_MODULES
    return False


class _Texts:
    """The texts that the expressions of a program may have."""

    def __init__(self, tree: ast.Module) -> None:
        self._tree, self._values = tree, PossibleValues(tree)
        self._reading: set[ast.expr] = set()  # expressions whose texts are being determined

    def given(self, skills: Mapping[str, list[str]]) -> dict[tuple[str, str], Templates]:
        """Return the texts of each argument, by skill and parameter. `skills` has each skill's parameters."""
        found: defaultdict[tuple[str, str], Templates] = defaultdict(lambda: NOTHING)
        called = set()
        for node in nodes(self._tree):
            match node:
                case ast.Call(ast.Name(skill) as function) if skill in skills:
                    called.add(function)
                    for name, texts in self._of_arguments(node, skills[skill]).items():
                        found[skill, name] |= texts
        for node in nodes(self._tree):
            if isinstance(node, ast.Name) and node.id in skills and node not in called:
                found |= {(node.id, name): UNKNOWN for name in skills[node.id]}
        return dict(found)

    def _of_arguments(self, call: ast.Call, names: Sequence[str]) -> dict[str, Templates]:
        """Return the texts of the arguments of a call, by the names of the parameters."""
        is_plain = not any(isinstance(one, ast.Starred) for one in call.args)
        given = dict(zip(names, call.args, strict=False)) if is_plain else {}
        given |= {one.arg: one.value for one in call.keywords if one.arg is not None}
        missing = NOTHING if is_plain and all(one.arg for one in call.keywords) else UNKNOWN
        return {name: self.texts(given[name]) if name in given else missing for name in names}

    def texts(self, node: ast.expr) -> Templates:
        """Return templates for all texts that an expression, or any element of a list, may have."""
        values = self._values.of(node)
        found = NOTHING.union(*(UNKNOWN if value is None else self._texts(value) for value in values))
        return found if len(found) <= MAX_TEMPLATES else UNKNOWN

    def _texts(self, node: ast.expr) -> Templates:
        if node in self._reading:  # a text that grows in a loop
            return UNKNOWN
        self._reading.add(node)
        found = UNKNOWN
        match node:
            case ast.Constant(str() | int() | float() as value):
                found = frozenset({TextTemplate((as_text(value),))})
            case ast.JoinedStr(parts):
                found = _joined([self.texts(part) for part in parts])
            case ast.FormattedValue(value, conversion, None) if conversion in {-1, ord("s")}:
                found = self.texts(value)
            case ast.BinOp(ast.Constant(str(text)), ast.Mod(), _) | ast.Call(
                ast.Attribute(ast.Constant(str(text)), "format")
            ) if not ESCAPED.search(text):
                found = frozenset({TextTemplate(tuple(FIELD.split(text)))})
            case ast.BinOp(left, ast.Add(), right):
                found = _joined([self.texts(left), self.texts(right)])
        self._reading.remove(node)
        return found


def _joined(some: Sequence[Templates]) -> Templates:
    """Return the texts that consist of one text of each set."""
    some = [UNKNOWN if one & UNKNOWN else one for one in some]
    if prod(map(len, some)) > MAX_COMBINATIONS:
        some = [one if len(one) == 1 else UNKNOWN for one in some]
    return frozenset(_concatenated(texts) for texts in product(*some))


def _concatenated(texts: Iterable[TextTemplate]) -> TextTemplate:
    parts = [""]
    for text in texts:
        first, *rest = text.parts
        parts[-1] += first
        parts += rest
    return TextTemplate(tuple(parts))
