"""Checks that a program has only names and expressions that tame programs may have (see `tame`)."""

from __future__ import annotations

import ast
import builtins
import re

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from typing import Any, ClassVar, NoReturn, TypeAlias

    Nodes: TypeAlias = Mapping[type[ast.AST], Sequence[Any]]
    Checks: TypeAlias = dict[type[ast.AST], Callable[[Any, Any], None]]


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


# Consumers use up their first argument immediately. All other functions take only data.
CONSUMERS = _words("all any dict len list max min next sorted sum tuple")
FUNCTIONS = CONSUMERS | _words("abs bool chr divmod float int ord pow print range repr round str")
ITERATORS = _words("enumerate filter map reversed zip")
DATA_CLASSES = _words("bool dict float int list str tuple")  # allowed in annotations
ERRORS = _words(
    """
    ArithmeticError AssertionError AttributeError BaseException EOFError Exception IndexError KeyError
    LookupError MemoryError NameError NotImplementedError OSError OverflowError RecursionError RuntimeError
    StopIteration TimeoutError TypeError UnboundLocalError ValueError ZeroDivisionError
    """
)
GIVEN = FUNCTIONS | ITERATORS | ERRORS  # all builtins that a tame program can use
# Names that programs may have without binding them, except `__name__`, which always holds data.
EXISTING = frozenset({*dir(builtins), "exit", "quit", "sys", "time"}) - {"__name__"}

DATA_METHODS = _words(
    """
    append capitalize casefold center clear copy count endswith expandtabs extend find get index insert
    isalnum isalpha isdecimal isdigit islower isnumeric isspace istitle isupper join ljust lower lstrip
    partition pop popitem remove removeprefix removesuffix replace reverse rfind rindex rjust rpartition
    rsplit rstrip setdefault sort split splitlines startswith strip swapcase title update upper zfill
    """
)
CONSUMING_METHODS = _words("extend join update")
VIEWS = _words("items keys values")
CLOCK = _words("asctime ctime gmtime localtime monotonic perf_counter sleep strftime time")
PLAIN_FIELDS = re.compile(r"(?:[^{}]|\{\{|\}\}|\{\w*(?:![rsa])?(?::[^{}]*)?\})*")
CONSTANTS = (type(None), bool, int, float, str, type(...))
TYPE_NODES = (ast.Constant, ast.Subscript, ast.Tuple, ast.BinOp, ast.BitOr, ast.Load)
OPERATOR_NODES = (ast.operator, ast.boolop, ast.unaryop, ast.expr_context)


class WildError(Exception):
    """Part of a program is not on the allowlist."""


def wild(*_: object) -> NoReturn:
    """Reject a node: raise WildError."""
    raise WildError


def parameters_of(given: ast.arguments) -> list[str]:
    """Return the names of a function's parameters."""
    several = (*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg)
    return [arg.arg for arg in several if arg is not None]


class ExpressionVerifier:
    """Raises WildError for an expression that is not allowed. `VALUES` has a check per allowed kind."""

    def __init__(self, nodes: Nodes, skills: frozenset[str]) -> None:
        self.skills = skills
        self.functions = {node.name for node in nodes.get(ast.FunctionDef, ())}
        self.bound = {  # names that are bound other than by `def`
            *(node.id for node in nodes.get(ast.Name, ()) if type(node.ctx) is not ast.Load),
            *(node.arg for node in nodes.get(ast.arg, ())),
            *(node.name for node in nodes.get(ast.ExceptHandler, ()) if node.name),
        }
        self.special = skills | GIVEN | EXISTING  # names that exist without being bound by the program
        self.hidden: list[frozenset[str]] = []  # special names that are data in each enclosing function
        for name in self.functions | self.bound:
            if name.startswith("__"):
                wild()
        if not self.functions.isdisjoint(self.bound) or not self.functions.isdisjoint(self.special):
            wild()

    def is_data(self, name: str) -> bool:
        """Return whether a name is bound to data here, or not bound at all."""
        if name in self.functions:
            return False
        if name not in self.special:
            return not name.startswith("__") or name == "__name__"
        return any(name in names for names in self.hidden)

    def _is_own(self, name: str) -> bool:
        """Return whether a name refers to one of the program's functions, or to a skill."""
        return name in self.functions or (name in self.skills and not self.is_data(name))

    def _is_given(self, name: str, among: frozenset[str]) -> bool:
        return name in among and not self.is_data(name)

    def _check_value(self, node: ast.expr) -> None:
        self.VALUES.get(type(node), wild)(self, node)

    def _check_name(self, node: ast.Name) -> None:
        if not self.is_data(node.id):
            wild()

    def check_parts(self, node: ast.AST) -> None:
        """Allow a node if all its parts are allowed."""
        for name in node._fields:
            part = getattr(node, name)
            for each in part if type(part) is list else (part,):
                self._check_part(each)

    def _check_part(self, part: object) -> None:
        if isinstance(part, ast.expr):
            self._check_value(part)
        elif isinstance(part, ast.AST) and not isinstance(part, OPERATOR_NODES):
            wild()

    def _check_iterable(self, node: ast.expr) -> None:
        """Allow data, or an iterator or view that is consumed immediately."""
        match node:
            case ast.GeneratorExp():
                self._check_comprehension(node)
            case ast.Call(ast.Name(name), args, keywords) if self._is_given(name, ITERATORS):
                if name in {"map", "filter"} and args:
                    self._check_callback(args[0])
                    args = args[1:]
                for each in args:
                    self._check_iterable(each)
                self._check_arguments((), keywords)
            case ast.Call(ast.Attribute(of, method), [], []) if method in VIEWS:
                self._check_value(of)
            case ast.Starred(inner):
                self._check_iterable(inner)
            case _:
                self._check_value(node)

    def _check_callback(self, node: ast.expr) -> None:
        """Allow a function, skill, builtin or lambda that a builtin calls immediately."""
        match node:
            case ast.Lambda(args, body):
                if not self.special.isdisjoint(parameters_of(args)):
                    wild()
                self._check_parameters(args)
                self._check_value(body)
            case ast.Name(name) if self._is_own(name) or self._is_given(name, FUNCTIONS - {"next"}):
                pass
            case _:
                self._check_value(node)

    def _check_parameters(self, given: ast.arguments) -> None:
        for default in (*given.defaults, *given.kw_defaults):
            if default is not None:
                self._check_value(default)
        for arg in (*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg):
            if arg is not None and arg.annotation is not None:
                self._check_annotation(arg.annotation)

    def _check_annotation(self, node: ast.expr) -> None:
        """Allow the types of data, such as `dict[str, int]`, since programs cannot read annotations."""
        for part in ast.walk(node):
            is_type = part.id in DATA_CLASSES if isinstance(part, ast.Name) else isinstance(part, TYPE_NODES)
            if not is_type:
                wild()

    def _check_call(self, node: ast.Call) -> None:
        match node.func:
            case ast.Name(name) if self._is_own(name) or self.is_data(name):
                self._check_arguments(node.args, node.keywords)
            case ast.Name(name) if self._is_given(name, FUNCTIONS):
                picks = name in {"max", "min"}  # with several arguments, they return one of them
                uses_up = name in CONSUMERS and not (picks and len(node.args) > 1)
                self._check_call_of_builtin(node, uses_up=uses_up, calls_key=picks or name == "sorted")
            case ast.Attribute(ast.Name("time"), method) if not self.is_data("time"):
                if method not in CLOCK:
                    wild()
                self._check_arguments(node.args, node.keywords)
            case ast.Attribute(ast.Constant(str(text)), "format") if PLAIN_FIELDS.fullmatch(text):
                self._check_arguments(node.args, node.keywords)
            case ast.Attribute(of, method) if method in DATA_METHODS:
                self._check_value(of)
                uses_up, calls_key = method in CONSUMING_METHODS, method == "sort"
                self._check_call_of_builtin(node, uses_up=uses_up, calls_key=calls_key)
            case _:
                wild()

    def _check_call_of_builtin(self, node: ast.Call, *, uses_up: bool, calls_key: bool) -> None:
        """Allow data as arguments. The builtin may also consume its first argument, and call `key`."""
        for number, each in enumerate(node.args):
            if uses_up and number == 0:
                self._check_iterable(each)
            else:
                self._check_argument(each)
        for keyword in node.keywords:
            if calls_key and keyword.arg == "key":
                self._check_callback(keyword.value)
            else:
                self._check_value(keyword.value)

    def _check_arguments(self, args: Sequence[ast.expr], keywords: Sequence[ast.keyword]) -> None:
        for each in args:
            self._check_argument(each)
        for keyword in keywords:
            self._check_value(keyword.value)

    def _check_argument(self, node: ast.expr) -> None:
        if type(node) is ast.Starred:
            self._check_iterable(node.value)
        else:
            self._check_value(node)

    def _check_display(self, node: ast.List | ast.Tuple) -> None:
        for each in node.elts:
            self._check_argument(each)

    def _check_comprehension(self, node: ast.ListComp | ast.DictComp | ast.GeneratorExp) -> None:
        """Allow a comprehension unless it binds a special name."""
        for each in node.generators:
            for inner in ast.walk(each.target):
                if isinstance(inner, ast.Name) and inner.id in self.special:
                    wild()
            self._check_value(each.target)
            self._check_iterable(each.iter)
            for condition in each.ifs:
                self._check_value(condition)
            if each.is_async:
                wild()
        for part in (node.key, node.value) if isinstance(node, ast.DictComp) else (node.elt,):
            self._check_value(part)

    def _check_comparison(self, node: ast.Compare) -> None:
        """Allow a comparison of data. `in` may also search an iterator."""
        sides = [node.left, *node.comparators]
        self._check_value(node.left)
        for operator, left, right in zip(node.ops, sides, sides[1:], strict=False):
            if isinstance(operator, ast.Is | ast.IsNot) and not (_is_single(left) or _is_single(right)):
                wild()
            if isinstance(operator, ast.In | ast.NotIn):
                self._check_iterable(right)
            else:
                self._check_value(right)

    def _check_constant(self, node: ast.Constant) -> None:
        if type(node.value) not in CONSTANTS:
            wild()

    VALUES: ClassVar[Checks] = {
        **dict.fromkeys((ast.BoolOp, ast.BinOp, ast.UnaryOp, ast.IfExp, ast.Subscript), check_parts),
        **dict.fromkeys((ast.Slice, ast.Dict, ast.JoinedStr, ast.FormattedValue), check_parts),
        **dict.fromkeys((ast.List, ast.Tuple), _check_display),
        **dict.fromkeys((ast.ListComp, ast.DictComp), _check_comprehension),
        ast.Name: _check_name,
        ast.Constant: _check_constant,
        ast.Call: _check_call,
        ast.Compare: _check_comparison,
    }


def _is_single(node: ast.expr) -> bool:
    """Return whether an expression is None, True or False, each of which is a single object."""
    return isinstance(node, ast.Constant) and (node.value is None or type(node.value) is bool)
