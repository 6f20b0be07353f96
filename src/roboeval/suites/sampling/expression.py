"""Evaluates expressions in task files: a small subset of Python that is interpreted, never executed."""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

from codebotler.core.program import parse_expression

MAX_VALUE_SIZE = 10_000  # characters, digits or entries of a value
Names = Mapping[str, Any]  # strings, numbers, lists, and namespaces for people and things


class ExpressionError(ValueError):
    """Raised if an expression is not valid or refers to an unknown name."""


def _product(one: object, other: object) -> int:
    if isinstance(one, int) and isinstance(other, int):
        return one * other
    raise TypeError("only whole numbers can be multiplied")


_OPERATORS: dict[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.In: lambda one, other: one in other,
    ast.NotIn: lambda one, other: one not in other,
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: _product,
    ast.FloorDiv: operator.floordiv,
}
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "count": lambda items: len([*items]),
    "number": lambda text: int(re.findall(r"\A\d+", text)[0]),
    "sum": sum,
    "any": any,
    "all": all,
    "max": max,
    "min": min,
}


@cache  # many worlds use the same few expressions
def parse_cached(text: str) -> ast.expr:
    """Parse an expression into a syntax tree. Raise ExpressionError if the syntax is invalid."""
    try:
        return parse_expression(text.strip())
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ExpressionError(f'"{text}" is not an expression; check its syntax') from None


def evaluate(node: ast.expr, names: Names) -> Any:  # noqa: ANN401 - strings, numbers, lists of them
    """Evaluate an expression, given the values of names. Raise ExpressionError if that is impossible."""
    try:
        return _checked_value(node, names)
    except ExpressionError:
        raise
    except RecursionError:
        raise ExpressionError("an expression is nested too deeply; shorten it") from None
    except (TypeError, KeyError, IndexError, ZeroDivisionError, ValueError, OverflowError) as error:
        raise ExpressionError(f'"{ast.unparse(node)}" cannot be computed ({error})') from None


def _checked_value(node: ast.expr, names: Names) -> Any:  # noqa: ANN401 - as `evaluate`
    found = _compute(node, names)
    if _size(found) > MAX_VALUE_SIZE:
        limit = f"{MAX_VALUE_SIZE:,} characters, digits or entries"
        raise ExpressionError(f'"{ast.unparse(node)}" exceeds {limit}; simplify it')
    return found


def _size(found: object) -> int:
    """Count the characters, digits or entries of a value, but stop once the limit is exceeded."""
    if isinstance(found, int):
        return found.bit_length() // 4
    if not isinstance(found, list | tuple):
        return len(found) if isinstance(found, str) else 1
    size = 0
    for one in found:
        size += 1 + _size(one)
        if size > MAX_VALUE_SIZE:
            break
    return size


def _compute(node: ast.expr, names: Names) -> Any:  # noqa: ANN401, C901, PLR0911, PLR0912 - a case per node
    match node:
        case ast.Constant(str() | int() as constant):
            return constant
        case ast.Name(name):
            if name not in names:
                raise ExpressionError(f'unknown name "{name}"; the known names are {", ".join(names)}')
            return names[name]
        case ast.Attribute(inner, name):
            whole = _checked_value(inner, names)
            if not isinstance(whole, SimpleNamespace) or name not in vars(whole):
                why = "is not an attribute; people and things have, for example, name and room"
                raise ExpressionError(f'".{name}" {why}')
            return getattr(whole, name)
        case ast.Subscript(inner, key):
            return _checked_value(inner, names)[_checked_value(key, names)]
        case ast.List(items) | ast.Tuple(items):
            return [_checked_value(item, names) for item in items]
        case ast.JoinedStr(parts):
            return "".join(str(_checked_value(part, names)) for part in parts)
        case ast.FormattedValue(inner, -1, None):
            return _checked_value(inner, names)
        case ast.BoolOp(op, parts):
            each = (bool(_checked_value(part, names)) for part in parts)
            return all(each) if isinstance(op, ast.And) else any(each)
        case ast.UnaryOp(ast.Not(), inner):
            return not _checked_value(inner, names)
        case ast.BinOp(left, op, right) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_checked_value(left, names), _checked_value(right, names))
        case ast.Compare(left, ops, others):
            values = [_checked_value(one, names) for one in (left, *others)]
            return all(_OPERATORS[type(op)](*two) for op, two in zip(ops, pairwise(values), strict=True))
        case ast.IfExp(test, body, orelse):
            return _checked_value(body if _checked_value(test, names) else orelse, names)
        case ast.ListComp(element, [loop]) | ast.GeneratorExp(element, [loop]):
            return [_checked_value(element, each) for each in iterate_loop(loop, names)]
        case ast.Call(ast.Name(name), [argument], []) if name in _FUNCTIONS:
            return _FUNCTIONS[name](_checked_value(argument, names))
    known = ""
    if isinstance(node, ast.Call):
        known = f"; the only functions are {', '.join(_FUNCTIONS)}, with one argument"
    raise ExpressionError(f'"{ast.unparse(node)}" is not allowed in an expression here{known}')


def iterate_loop(loop: ast.comprehension, names: Names) -> Iterator[Names]:
    """Yield `names` plus the loop variable for each iteration of a loop like `for p in people if p.room`."""
    if not isinstance(loop.target, ast.Name) or loop.is_async:
        raise ExpressionError(f'"{ast.unparse(loop.target)}" is not a single name; write for NAME in ...')
    items = _checked_value(loop.iter, names)
    if isinstance(items, str) or not isinstance(items, Iterable):
        raise ExpressionError(f'"{ast.unparse(loop.iter)}" is not a list; loop over a list such as people')
    for item in items:
        each = {**names, loop.target.id: item}
        if all(_checked_value(test, each) for test in loop.ifs):
            yield each
