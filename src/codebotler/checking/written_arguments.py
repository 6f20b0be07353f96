"""Find the texts that a program gives to its skills, by reading its source without running it."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product, zip_longest
from typing import TypeAlias

from codebotler.core.program import all_bound_names, nodes, parse_leniently
from codebotler.core.skills.table import SkillTable
from codebotler.core.skills.values import as_text
from codebotler.core.text_template import TextTemplate
from codebotler.simulator.isolated_call import IsolatedCallError, isolated

ANY_TEXT = TextTemplate(("", ""))
MAX_TEMPLATES, MAX_COMBINATIONS = 50, 8  # more become any text
FIELD = re.compile(r"%[-+ #0]*\d*(?:\.\d+)?[a-zA-Z]|\{[^{}]*\}")
"""A gap in a text that is formatted with `%` or `format`, where any text may be."""

ESCAPED = re.compile(r"%%|\{\{|\}\}|%\(|%[^a-zA-Z]*\*")
CLOCKS = frozenset({"datetime", "random", "secrets", "uuid"})
TRICKS = frozenset(
    {"eval", "exec", "globals", "locals", "vars", "getattr", "__builtins__", "__import__", "sys"}
)
UNCHANGED = frozenset({"strip", "lower", "upper", "title", "capitalize", "casefold", "lstrip", "rstrip"})
"""Methods whose result is the same text for a template, which ignores case and surrounding whitespace."""

CHANGES = frozenset({"extend", "insert", "update", "setdefault", "appendleft"})
"""Methods that may give a list any other elements."""

Templates: TypeAlias = frozenset[TextTemplate]
UNKNOWN: Templates = frozenset({ANY_TEXT})
NOTHING: Templates = frozenset()


@dataclass(frozen=True)
class ArgumentTexts:
    """The texts that an argument of a skill may have.

    Args:
        templates: the known ones.
        is_bounded: whether there are no others.
    """

    templates: tuple[TextTemplate, ...] = ()
    is_bounded: bool = True


@dataclass(frozen=True)
class WrittenArguments:
    """The arguments that the text of a program gives to its skills.

    Args:
        skills: the texts of each argument, by the skill's and the parameter's name.
        reads_clock: whether the program may depend on the time of day or on random numbers.
    """

    skills: Mapping[str, Mapping[str, ArgumentTexts]]
    reads_clock: bool


def read_arguments(program: str, skills: SkillTable) -> WrittenArguments:
    """Return what the text of a program gives to its skills. A text that cannot be read tells nothing."""
    parameters = [(row.name, [one.name for one in row.parameters]) for row in skills.rows]
    try:
        found, reads_clock = _read(program, parameters)
    except IsolatedCallError:
        found, reads_clock = [(skill, name, [], False) for skill, names in parameters for name in names], True
    texts: defaultdict[str, dict[str, ArgumentTexts]] = defaultdict(dict)
    for skill, name, parts, is_bounded in found:
        texts[skill][name] = ArgumentTexts(tuple(TextTemplate(tuple(one)) for one in parts), is_bounded)
    return WrittenArguments(texts, reads_clock)


_Found: TypeAlias = list[tuple[str, str, list[list[str]], bool]]


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
    found = [
        (skill, name, sorted([*one.parts] for one in templates - UNKNOWN), not templates & UNKNOWN)
        for (skill, name), templates in given.items()
    ]
    return found, _reads_clock(tree)


def _reads_clock(tree: ast.Module) -> bool:
    """Return whether a program uses a clock or random numbers, rather than only waiting."""
    for node in nodes(tree):
        match node:
            case ast.Name(name) | ast.Attribute(ast.Name(name)) if name in CLOCKS:
                return True
            case ast.ImportFrom(module) if module in CLOCKS:
                return True
            case ast.ImportFrom("time", names) if any(one.name != "sleep" for one in names):
                return True
            case ast.Attribute(ast.Name("time"), attribute) if attribute != "sleep":
                return True
    return False


class _Texts:
    """The texts that the names of a program may have, whatever their scope and the order of statements."""

    def __init__(self, tree: ast.Module) -> None:
        self._tree = tree
        self._values: defaultdict[str, list[ast.expr | None]] = defaultdict(list)  # None for an unknown value
        self._functions = {node.name: node for node in nodes(tree) if isinstance(node, ast.FunctionDef)}
        self._reading: set[str] = set()  # names whose texts are being determined
        for node in nodes(tree):
            for target, value in _bindings(node):
                self._bind(target, value)
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                self._bind_parameters(node, self._functions.get(node.func.id))

    def given(self, skills: Mapping[str, list[str]]) -> dict[tuple[str, str], Templates]:
        """Return the texts of each argument of each skill that the program names."""
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
        """Return the possible texts of an expression, or of the elements of a list."""
        found = self._texts(node)
        return found if len(found) <= MAX_TEMPLATES else UNKNOWN

    def _texts(self, node: ast.expr) -> Templates:
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
            case ast.BinOp(left, ast.Add(), right) if self._is_list(left) or self._is_list(right):
                found = self.texts(left) | self.texts(right)
            case ast.BinOp(left, ast.Add(), right):
                found = _joined([self.texts(left), self.texts(right)])
            case ast.Call(ast.Name(name)) if name in self._functions:
                returned = [one.value for one in nodes(self._functions[name]) if isinstance(one, ast.Return)]
                found = self._of_name(f"{name}()", returned)
            case ast.Name(name):
                found = self._of_name(name, self._values.get(name, [None]))
            case _ if parts := _parts(node):
                found = NOTHING.union(*map(self.texts, parts))
        return found

    def _is_list(self, node: ast.expr) -> bool:
        values = self._values[node.id] if isinstance(node, ast.Name) and node.id in self._values else [node]
        return any(isinstance(value, ast.List | ast.Tuple | ast.ListComp) for value in values)

    def _of_name(self, name: str, values: Iterable[ast.expr | None]) -> Templates:
        if name in self._reading:  # a text that grows in a loop
            return UNKNOWN
        self._reading.add(name)
        found = NOTHING.union(*(UNKNOWN if value is None else self.texts(value) for value in values))
        self._reading.remove(name)
        return found

    def _bind(self, target: ast.expr, value: ast.expr | None) -> None:
        match target, value:
            case ast.Name(name), _:
                self._values[name].append(value)
            case ((ast.Tuple(targets) | ast.List(targets)), (ast.Tuple(values) | ast.List(values))):
                for one, its in zip_longest(targets, values):
                    if one is not None:
                        self._bind(one, its)
            case ((ast.Tuple(targets) | ast.List(targets)), _):
                for one in targets:
                    self._bind(one, None)
            case ast.Starred(one), _:
                self._bind(one, None)

    def _bind_parameters(self, call: ast.Call, function: ast.FunctionDef | None) -> None:
        if function is None:
            return
        names = [
            one.arg for one in (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)
        ]
        for name, value in zip(names, call.args, strict=False):
            self._values[name].append(None if isinstance(value, ast.Starred) else value)
        for keyword in call.keywords:
            for name in [keyword.arg] if keyword.arg else names:
                self._values[name].append(keyword.value if keyword.arg else None)


def _parts(node: ast.expr) -> list[ast.expr]:
    """Return the expressions of which one is the value of another one, or an element of it."""
    match node:
        case ast.IfExp(_, one, other):
            return [one, other]
        case ast.BoolOp(_, some) | ast.List(some) | ast.Tuple(some) | ast.Set(some):
            return some
        case ast.NamedExpr(_, value) | ast.Call(ast.Name("str" | "list" | "sorted"), [value], []):
            return [value]
        case ast.Call(ast.Attribute(value, method), []) if method in UNCHANGED:
            return [value]
    return []


def _bindings(node: ast.AST) -> Iterator[tuple[ast.expr, ast.expr | None]]:
    """Yield each target that a node binds, with its value or each of its values, or with None if unknown."""
    match node:
        case ast.Assign(targets, value):
            yield from ((target, value) for target in targets)
        case ast.AnnAssign(target, value=ast.expr() as value) | ast.NamedExpr(target, value):
            yield target, value
        case ast.AugAssign(target, operator, value):
            yield target, ast.BinOp(target, operator, value)
        case ast.For(target, over) | ast.comprehension(target, over):
            known = [over if isinstance(over, ast.Name) else None]
            values = over.elts if isinstance(over, ast.List | ast.Tuple | ast.Set) else known
            yield from ((target, value) for value in values)
        case ast.Call(ast.Attribute(ast.Name() as target, "append" | "add"), [value]):
            yield target, value
        case ast.Call(ast.Attribute(ast.Name() as target, method)) if method in CHANGES:
            yield target, None
        case ast.withitem(optional_vars=ast.expr() as target):
            yield target, None
        case ast.arguments(kwonlyargs=only):
            positional = [*node.posonlyargs, *node.args]
            defaults = [*zip(reversed(positional), reversed(node.defaults), strict=False)]
            defaults += [(one, value) for one, value in zip(only, node.kw_defaults, strict=True) if value]
            yield from ((ast.Name(one.arg), value) for one, value in defaults)
            yield from ((ast.Name(one.arg), None) for one in (node.vararg, node.kwarg) if one is not None)


def _joined(some: Sequence[Templates]) -> Templates:
    """Return the texts that consist of one text of each set."""
    count = 1
    for one in some:
        count *= len(one)
    if count > MAX_COMBINATIONS:
        some = [one if len(one) == 1 else UNKNOWN for one in some]
    return frozenset(_concatenated(texts) for texts in product(*some))


def _concatenated(texts: Iterable[TextTemplate]) -> TextTemplate:
    parts = [""]
    for text in texts:
        first, *rest = text.parts
        parts[-1] += first
        parts += rest
    return TextTemplate(tuple(parts))
