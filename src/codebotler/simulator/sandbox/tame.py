"""Decides whether a program is tame: so simple that no run of it can leave anything behind in its process.

Tame programs share a process, and run one after another. An allowlist for the syntax tree restricts them to
functions that work on None, booleans, numbers, strings, lists, tuples and dictionaries:

- Functions, skills, builtins and `time` may only be called, or passed to a builtin that calls them at once,
  and are never rebound. So no variable can hold a function, and no program can print its address.
- Attributes are methods of data, and are called immediately. No name may begin with two underscores.
- Iterators and dictionary views are consumed where they are created. Sets are not allowed, since their order
  depends on earlier runs in the process.
- `is` may only compare with None, True and False, since equal values may or may not be the same object.

Any other program is wild, and runs in its own process. So does a tame program that exhausts time, memory or
depth, which this module does not check.
"""

from __future__ import annotations

import ast
import builtins
import re

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from typing import Any, ClassVar, NoReturn, TypeAlias

    Nodes: TypeAlias = Mapping[type[ast.AST], Sequence[Any]]


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
OWN_SCOPES = (ast.FunctionDef, ast.Lambda, ast.ListComp, ast.DictComp, ast.GeneratorExp)


class WildError(Exception):
    """Raised for a program that needs its own process, since it has a construct not on the allowlist."""


def wild(*_: object) -> NoReturn:
    """Raise WildError, because the program contains a construct that is not on the allowlist."""
    raise WildError


def parameters_of(given: ast.arguments) -> list[str]:
    """Return the names of a function's parameters."""
    several = (*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg)
    return [arg.arg for arg in several if arg is not None]


def is_tame(tree: ast.Module, nodes: Nodes, skills: frozenset[str]) -> bool:
    """Return whether a program may share a process with others. `nodes` holds the tree's nodes by type."""
    try:
        ProgramVerifier(nodes, skills).check(*tree.body)
    except (WildError, RecursionError):
        return False
    return True


class ProgramVerifier:
    """Checks the syntax tree of a program. `ALLOWED` maps each type of node to the method that checks it."""

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
        """Return whether a name in the current function can only be data, not a function or builtin."""
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

    def check(self, *nodes: ast.stmt | ast.expr) -> None:
        """Raise WildError if one of these statements or expressions is not allowed."""
        for node in nodes:
            self.ALLOWED.get(type(node), wild)(self, node)

    def _check_name(self, node: ast.Name) -> None:
        if not self.is_data(node.id):
            wild()

    def _check_parts(self, node: ast.AST) -> None:
        """Allow a node if all its parts are allowed."""
        for name in node._fields:
            part = getattr(node, name)
            for each in part if type(part) is list else (part,):
                if isinstance(each, ast.stmt | ast.expr):
                    self.check(each)
                elif isinstance(each, ast.AST) and not isinstance(each, OPERATOR_NODES):
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
                self.check(of)
            case ast.Starred(inner):
                self._check_iterable(inner)
            case _:
                self.check(node)

    def _check_callback(self, node: ast.expr) -> None:
        """Allow a function, skill, builtin or lambda that a builtin calls immediately."""
        match node:
            case ast.Lambda(args, body):
                if not self.special.isdisjoint(parameters_of(args)):
                    wild()
                self._check_parameters(args)
                self.check(body)
            case ast.Name(name) if self._is_own(name) or self._is_given(name, FUNCTIONS - {"next"}):
                pass
            case _:
                self.check(node)

    def _check_parameters(self, given: ast.arguments) -> None:
        for default in (*given.defaults, *given.kw_defaults):
            if default is not None:
                self.check(default)
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
                self.check(of)
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
                self.check(keyword.value)

    def _check_arguments(self, args: Sequence[ast.expr], keywords: Sequence[ast.keyword]) -> None:
        for each in args:
            self._check_argument(each)
        for keyword in keywords:
            self.check(keyword.value)

    def _check_argument(self, node: ast.expr) -> None:
        if type(node) is ast.Starred:
            self._check_iterable(node.value)
        else:
            self.check(node)

    def _check_display(self, node: ast.List | ast.Tuple) -> None:
        for each in node.elts:
            self._check_argument(each)

    def _check_comprehension(self, node: ast.ListComp | ast.DictComp | ast.GeneratorExp) -> None:
        """Allow a comprehension unless it binds a special name."""
        for each in node.generators:
            for inner in ast.walk(each.target):
                if isinstance(inner, ast.Name) and inner.id in self.special:
                    wild()
            self.check(each.target)
            self._check_iterable(each.iter)
            for condition in each.ifs:
                self.check(condition)
            if each.is_async:
                wild()
        for part in (node.key, node.value) if isinstance(node, ast.DictComp) else (node.elt,):
            self.check(part)

    def _check_comparison(self, node: ast.Compare) -> None:
        """Allow a comparison of data. `in` may also search an iterator."""
        sides = [node.left, *node.comparators]
        self.check(node.left)
        for operator, left, right in zip(node.ops, sides, sides[1:], strict=False):
            if isinstance(operator, ast.Is | ast.IsNot) and not (_is_single(left) or _is_single(right)):
                wild()
            if isinstance(operator, ast.In | ast.NotIn):
                self._check_iterable(right)
            else:
                self.check(right)

    def _check_constant(self, node: ast.Constant) -> None:
        if type(node.value) not in CONSTANTS:
            wild()

    # --- statements

    def _check_function(self, node: ast.FunctionDef) -> None:
        """Allow a function, which may use a special name for its own data."""
        if node.decorator_list or getattr(node, "type_params", None):
            wild()
        if node.returns is not None:
            self._check_annotation(node.returns)
        self._check_parameters(node.args)
        hides = not self.special.isdisjoint(self.bound)
        self.hidden.append(self.special & _names_bound_in(node) if hides else frozenset())
        self.check(*node.body)
        self.hidden.pop()

    def _check_declaration(self, node: ast.Global | ast.Nonlocal) -> None:
        for name in node.names:
            if name in self.functions or name in self.special or name.startswith("__"):
                wild()

    def _check_import(self, node: ast.Import) -> None:
        """Allow `import time`, which programs can use without an import as well."""
        for alias in node.names:
            if alias.name != "time" or alias.asname not in {None, "time"} or self.is_data("time"):
                wild()

    def _check_annotated(self, node: ast.AnnAssign) -> None:
        """Allow an annotated assignment, but not `(name): int`, which binds nothing."""
        if node.value is None and not node.simple:
            wild()
        self.check(node.target)
        self._check_annotation(node.annotation)
        if node.value is not None:
            self.check(node.value)

    def _check_loop(self, node: ast.For) -> None:
        self.check(node.target)
        self._check_iterable(node.iter)
        self.check(*node.body, *node.orelse)

    def _check_try(self, node: ast.Try) -> None:
        """Allow `try`. A caught error may be printed or raised again, like any data."""
        self.check(*node.body)
        for handler in node.handlers:
            if handler.name is not None and not self.is_data(handler.name):
                wild()
            kinds = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type]
            for kind in kinds:
                if kind is not None and not (isinstance(kind, ast.Name) and self._is_given(kind.id, ERRORS)):
                    wild()
            self.check(*handler.body)
        self.check(*node.orelse, *node.finalbody)

    def _check_raise(self, node: ast.Raise) -> None:
        for part in (node.exc, node.cause):
            match part:
                case ast.Name(name) if self._is_given(name, ERRORS):
                    pass
                case ast.Call(ast.Name(name), args, keywords) if self._is_given(name, ERRORS):
                    self._check_arguments(args, keywords)
                case ast.expr():
                    self.check(part)

    ALLOWED: ClassVar[dict[type[ast.AST], Callable[[Any, Any], None]]] = {
        **dict.fromkeys((ast.BoolOp, ast.BinOp, ast.UnaryOp, ast.IfExp, ast.Subscript), _check_parts),
        **dict.fromkeys((ast.Slice, ast.Dict, ast.JoinedStr, ast.FormattedValue), _check_parts),
        **dict.fromkeys((ast.Expr, ast.Assign, ast.AugAssign, ast.While, ast.If, ast.Return), _check_parts),
        **dict.fromkeys((ast.Assert, ast.Delete, ast.Pass, ast.Break, ast.Continue), _check_parts),
        **dict.fromkeys((ast.List, ast.Tuple), _check_display),
        **dict.fromkeys((ast.ListComp, ast.DictComp), _check_comprehension),
        **dict.fromkeys((ast.Global, ast.Nonlocal), _check_declaration),
        ast.Name: _check_name,
        ast.Constant: _check_constant,
        ast.Call: _check_call,
        ast.Compare: _check_comparison,
        ast.AnnAssign: _check_annotated,
        ast.FunctionDef: _check_function,
        ast.Import: _check_import,
        ast.For: _check_loop,
        ast.Try: _check_try,
        ast.Raise: _check_raise,
    }


def _names_bound_in(function: ast.FunctionDef) -> set[str]:
    """Return the function's local names, which hide the same names of the module throughout its body."""
    names = set(parameters_of(function.args))
    waiting: list[Any] = list(function.body)
    while waiting:
        node = waiting.pop()
        kind = type(node)
        if kind is ast.Name:
            if type(node.ctx) is not ast.Load:
                names.add(node.id)
        elif kind is ast.ExceptHandler and node.name:
            names.add(node.name)
        if kind not in OWN_SCOPES:
            waiting.extend(ast.iter_child_nodes(node))
    return names


def _is_single(node: ast.expr) -> bool:
    """Return whether an expression is None, True or False, each of which is a single object."""
    return isinstance(node, ast.Constant) and (node.value is None or type(node.value) is bool)
