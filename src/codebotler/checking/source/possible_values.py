"""Find the expressions that may give names their values, by reading a program without running it."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import TypeAlias

from codebotler.core.program import nodes

SAME_VALUES = frozenset({"str", "list", "set", "tuple", "sorted", "reversed", "iter", "filter", "frozenset"})
"""Functions whose result has the values of their last argument."""

SAME_METHODS = frozenset(
    {
        *("strip", "lstrip", "rstrip", "lower", "upper", "title", "capitalize", "casefold"),
        *("copy", "keys", "pop"),
    }
)
"""Methods whose result has the values of their object, apart from case and surrounding whitespace."""

CHANGES = frozenset({"insert", "update", "setdefault", "appendleft"})
"""Methods after which a list or dictionary may have unknown elements."""

SEQUENCES = ast.List | ast.Tuple | ast.ListComp

PossibleValue: TypeAlias = ast.expr | None
"""An expression that gives a value, or None for an unknown one."""


class PossibleValues:
    """Finds the values that an expression may have. It ignores scopes and the order of statements.

    Args:
        tree: the program.
        guess_entries: whether `x[0]` counts as any element of `x`; otherwise, `x[0]` stays as it is. For
            a dictionary, this wrongly gives its keys, so use it only where some wrong values do no harm.
    """

    def __init__(self, tree: ast.Module, *, guess_entries: bool = False) -> None:
        self._guess_entries = guess_entries
        self._values: defaultdict[str, list[PossibleValue]] = defaultdict(list)  # by name
        self._own: dict[ast.AST, str] = {}  # the names of the variables of comprehensions, inner ones last
        for node in nodes(tree):
            if isinstance(node, ast.ListComp | ast.SetComp | ast.GeneratorExp | ast.DictComp):
                bound = {n.id for g in node.generators for n in ast.walk(g.target) if isinstance(n, ast.Name)}
                inside = {*ast.walk(node)} - {*ast.walk(node.generators[0].iter)}
                own = (one for one in inside if isinstance(one, ast.Name) and one.id in bound)
                self._own |= {one: f"{one.id} {node.lineno} {node.col_offset}" for one in own}
        self._functions = {node.name: node for node in nodes(tree) if isinstance(node, ast.FunctionDef)}
        self._returned: dict[str, list[PossibleValue]] = {
            name: [node.value for node in ast.walk(function) if isinstance(node, ast.Return)]
            for name, function in self._functions.items()
        }
        for node in nodes(tree):
            for target, value in _bindings(node):
                self._bind(target, value)
            if isinstance(node, ast.Lambda):
                for one in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs):
                    self._values[one.arg].append(None)
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                self._bind_parameters(node, self._functions.get(node.func.id))

    def variable(self, name: ast.Name) -> str:
        """Return a variable's name. For a comprehension's own variable, add the comprehension's position."""
        return self._own.get(name, name.id)

    def of(self, node: ast.expr) -> list[PossibleValue]:
        """Return the possible values of a node, such as "hall" for `room`, with None for an unknown value."""
        found: list[PossibleValue] = []
        seen: set[str | ast.expr] = set()
        waiting: list[PossibleValue] = [node]
        while waiting:
            one = waiting.pop()
            parts = None if one is None else self._parts(one)
            if one is None or parts is None:
                found.append(one)
            elif (key := self.variable(one) if isinstance(one, ast.Name) else one) not in seen:
                seen.add(key)
                waiting += parts
        return found

    def _parts(self, node: ast.expr) -> Sequence[PossibleValue] | None:
        """Return the expressions of which one is the value, or an element, of another; None if unknown."""
        parts: Sequence[PossibleValue] | None = None
        match node:
            case ast.Name():
                parts = self._values.get(self.variable(node), [None])
            case ast.Call(ast.Name(name)) if name in self._functions:
                parts = self._returned[name]
            case ast.Call(ast.Name(name), [*_, value]) if name in SAME_VALUES:
                parts = [value]
            case ast.Call(ast.Attribute(value, method), []) if method in SAME_METHODS:
                parts = [value]
            case ast.IfExp(_, one, other):
                parts = [one, other]
            case ast.BoolOp(_, some) | ast.List(some) | ast.Tuple(some) | ast.Set(some) | ast.Dict(some):
                parts = some
            case ast.ListComp(one) | ast.SetComp(one) | ast.GeneratorExp(one) | ast.NamedExpr(_, one):
                parts = [one]
            case ast.BinOp(left, ast.Add(), right) if self._is_list(node):
                parts = [left, right]
            case ast.Subscript(value) if self._guess_entries:
                parts = [value]
        return parts

    def _is_list(self, node: ast.expr) -> bool:
        match node:
            case ast.BinOp(left, ast.Add(), right):
                return self._is_list(left) or self._is_list(right)
            case ast.Name():
                values = self._values.get(self.variable(node), ())
                return any(isinstance(value, SEQUENCES) for value in values)
        return isinstance(node, SEQUENCES)

    def _bind(self, target: ast.expr, value: PossibleValue) -> None:
        match target, value:
            case ast.Name() as name, _:
                self._values[self.variable(name)].append(value)
            case ((ast.Tuple(targets) | ast.List(targets)), (ast.Tuple(values) | ast.List(values))) if len(
                targets
            ) == len(values):
                for one, its in zip(targets, values, strict=True):
                    self._bind(one, its)
            case ((ast.Tuple(targets) | ast.List(targets)), _):  # each may get any of the elements
                for one in targets:
                    self._bind(one, _elements(value))
            case ast.Starred(one), _:
                self._bind(one, None)

    def _bind_parameters(self, call: ast.Call, function: ast.FunctionDef | None) -> None:
        if function is None:
            return
        given = function.args
        names = [one.arg for one in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
        for name, value in zip(names, call.args, strict=False):
            self._values[name].append(None if isinstance(value, ast.Starred) else value)
        for keyword in call.keywords:
            for name in [keyword.arg] if keyword.arg else names:
                self._values[name].append(keyword.value if keyword.arg else None)


def _elements(value: PossibleValue) -> PossibleValue:
    """Return an expression with the values of the elements of another one. Those of a text are unknown."""
    return None if isinstance(value, ast.Constant | ast.JoinedStr) else value


def _bindings(node: ast.AST) -> Iterator[tuple[ast.expr, PossibleValue]]:
    """Yield each target that a node binds, with its value or each of its values."""
    match node:
        case ast.Assign(targets, value):
            yield from ((target, value) for target in targets)
        case ast.AnnAssign(target, value=ast.expr() as value) | ast.NamedExpr(target, value):
            yield target, value
        case ast.AugAssign(target, operator, value):
            yield target, ast.BinOp(target, operator, value)
        case ast.For(target, over) | ast.comprehension(target, over):
            yield from _loop_bindings(target, over)
        case ast.Call(ast.Attribute(ast.Name() as target, "append" | "add"), [value]):
            yield target, value
        case ast.Call(ast.Attribute(ast.Name() as target, "extend"), [value]):
            yield target, _elements(value)
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


def _loop_bindings(target: ast.expr, over: ast.expr) -> Iterator[tuple[ast.expr, PossibleValue]]:
    match target, over:
        case ast.Tuple([number, each]), ast.Call(ast.Name("enumerate"), [many, *_]):
            yield number, None
            yield from _loop_bindings(each, many)
        case ast.Tuple(targets), ast.Call(ast.Name("zip"), some) if len(targets) == len(some):
            for each, many in zip(targets, some, strict=True):
                yield from _loop_bindings(each, many)
        case ast.Tuple([key, value]), ast.Call(ast.Attribute(of, "items"), []):
            yield key, of
            values = of.values if isinstance(of, ast.Dict) else [None]
            yield from ((value, one) for one in values)
        case _, (ast.List(rows) | ast.Tuple(rows) | ast.Set(rows)):
            yield from ((target, row) for row in rows)
        case _:
            yield target, _elements(over)
