"""Decides whether a program is tame: so plain that no run of it can leave anything behind in its process.

Tame programs share a process with others, one run after the other. An allowlist over the syntax tree keeps
them to functions over None, truth values, numbers, texts, lists, tuples and dictionaries:

- Functions, skills, builtins and `time` are named only to be called, or given to a builtin that calls them on
  the spot; none is rebound. So no variable ever holds one, and no address of one can be said.
- Attributes are methods of data, called at once. Nothing is read or written that begins with two underscores.
- Iterators and views of dictionaries are used up where they arise. Sets are none of the data: their order
  depends on what the process has done before.
- `is` compares with None, True and False only, since all else may be one object or two.

Whatever is not allowed here is wild, and runs in a process of its own. So does a tame program that exhausts
time, memory or depth, of which nothing is said here.
"""

from __future__ import annotations

import ast
import builtins
import re
from functools import lru_cache

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from typing import Any, NoReturn, TypeAlias

    Nodes: TypeAlias = Mapping[type[ast.AST], Sequence[Any]]


def words(text: str) -> frozenset[str]:
    """The words of a text."""
    return frozenset(text.split())


# Builtins that use up their first argument on the spot, and those that only take data.
CONSUMERS = words("all any dict len list max min next sorted sum tuple")
FUNCTIONS = CONSUMERS | words("abs bool chr divmod float int ord pow print range repr round str")
ITERATORS = words("enumerate filter map reversed zip")
DATA_CLASSES = words("bool dict float int list str tuple")  # for `isinstance` and annotations
ERRORS = words(
    """
    ArithmeticError AssertionError AttributeError BaseException EOFError Exception IndexError KeyError
    LookupError MemoryError NameError NotImplementedError OSError OverflowError RecursionError RuntimeError
    StopIteration TimeoutError TypeError UnboundLocalError ValueError ZeroDivisionError
    """
)
GIVEN = FUNCTIONS | ITERATORS | ERRORS | {"isinstance"}  # all builtins that a tame program finds
# All that some program finds, but for the name of its module, which all of them find.
EXISTING = frozenset({*dir(builtins), "exit", "quit", "sys", "time"}) - {"__name__"}

TEXT_METHODS = words(
    """
    capitalize casefold center count endswith expandtabs find index isalnum isalpha isdecimal isdigit islower
    isnumeric isspace istitle isupper join ljust lower lstrip partition removeprefix removesuffix replace
    rfind rindex rjust rpartition rsplit rstrip split splitlines startswith strip swapcase title upper zfill
    """
)
DATA_METHODS = TEXT_METHODS | words(
    "append clear copy extend get insert pop popitem remove reverse setdefault sort update"
)
CONSUMING_METHODS = words("extend join update")
VIEWS = words("items keys values")
CLOCK = words("asctime ctime gmtime localtime monotonic perf_counter sleep strftime time")
PARTS_OF_TIME = words("tm_year tm_mon tm_mday tm_hour tm_min tm_sec tm_wday tm_yday")
PLAIN_FIELDS = re.compile(r"(?:[^{}]|\{\{|\}\}|\{\w*(?:![rsa])?(?::[^{}]*)?\})*")
CONSTANTS = (type(None), bool, int, float, str, type(...))


def is_tame(tree: ast.Module, nodes: Nodes, skills: frozenset[str]) -> bool:
    """Whether a program is tame.

    Args:
        tree: its syntax tree.
        nodes: all nodes of the tree by type.
        skills: the names of the skills that it may call.
    """
    try:
        Verifier(nodes, skills).statements(tree.body)
    except (WildError, RecursionError):
        return False
    return True


class WildError(Exception):
    """Something is not on the allowlist."""


class Verifier:
    """Goes through a program once, and raises WildError at the first thing that is not on the allowlist."""

    def __init__(self, nodes: Nodes, skills: frozenset[str]) -> None:
        self.skills = skills
        self.functions = {node.name for node in nodes.get(ast.FunctionDef, ())}
        self.bound = {  # names that are bound in any way but by `def`
            *(node.id for node in nodes.get(ast.Name, ()) if type(node.ctx) is not ast.Load),
            *(node.arg for node in nodes.get(ast.arg, ())),
            *(node.name for node in nodes.get(ast.ExceptHandler, ()) if node.name),
        }
        self.special = special(skills)
        self.hides = not self.special.isdisjoint(self.bound)
        self.hidden: list[frozenset[str]] = []  # of each function around: what is data there, and no builtin
        for name in self.functions | self.bound:
            if name.startswith("__"):
                wild()
        if not self.functions.isdisjoint(self.bound) or not self.functions.isdisjoint(self.special):
            wild()

    # --- names

    def is_data(self, name: str) -> bool:
        """Whether a name stands for data here, or for nothing at all."""
        if name in self.functions:
            return False
        if name not in self.special:
            return not name.startswith("__") or name == "__name__"
        return any(name in names for names in self.hidden)

    def is_own(self, name: str) -> bool:
        """Whether a name stands for a function that the program defines, or a skill."""
        return name in self.functions or (name in self.skills and not self.is_data(name))

    def is_given(self, name: str, among: frozenset[str]) -> bool:
        """Whether a name stands for one of these builtins here."""
        return name in among and not self.is_data(name)

    def name(self, node: ast.Name) -> None:
        """Allow a name of data, also where it is bound."""
        if not self.is_data(node.id):
            wild()

    # --- statements

    def statements(self, body: Sequence[ast.stmt]) -> None:
        """Allow statements."""
        for node in body:
            STATEMENTS.get(type(node), wild)(self, node)

    def function(self, node: ast.FunctionDef) -> None:
        """Allow a function, in which a builtin's name may stand for data."""
        if node.decorator_list or getattr(node, "type_params", None):
            wild()
        if node.returns is not None:
            self.annotation(node.returns)
        self.parameters(node.args)
        self.hidden.append(self.special & hidden_in(node) if self.hides else frozenset())
        self.statements(node.body)
        self.hidden.pop()

    def parameters(self, given: ast.arguments) -> None:
        """Allow what stands around the parameters of a function."""
        for default in (*given.defaults, *given.kw_defaults):
            if default is not None:
                self.value(default)
        for arg in (*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg):
            if arg is not None and arg.annotation is not None:
                self.annotation(arg.annotation)

    def annotation(self, node: ast.expr) -> None:
        """Allow an annotation, which is never looked at again."""
        match node:
            case ast.Constant(value) if value is None or value is ... or isinstance(value, str):
                pass
            case ast.Name(name) if name in DATA_CLASSES or self.is_data(name):
                pass
            case ast.Subscript(of, inner):
                self.annotation(of)
                self.annotation(inner)
            case ast.BinOp(left, ast.BitOr(), right):
                self.annotation(left)
                self.annotation(right)
            case ast.Tuple(elts) | ast.List(elts):
                for part in elts:
                    self.annotation(part)
            case _:
                wild()

    def declaration(self, node: ast.Global | ast.Nonlocal) -> None:
        """Allow names of data to be those of an outer scope."""
        for name in node.names:
            if name in self.functions or name in self.special or name.startswith("__"):
                wild()

    def imported(self, node: ast.Import) -> None:
        """Allow `import time`, which is there anyway."""
        for alias in node.names:
            if alias.name != "time" or alias.asname not in {None, "time"} or self.is_data("time"):
                wild()

    def annotated(self, node: ast.AnnAssign) -> None:
        """Allow an assignment with an annotation, but not `(name): int`, which binds nothing."""
        if node.value is None and not node.simple:
            wild()
        self.value(node.target)
        self.annotation(node.annotation)
        if node.value is not None:
            self.value(node.value)

    def loop(self, node: ast.For) -> None:
        """Allow a loop."""
        self.value(node.target)
        self.consumed(node.iter)
        self.statements(node.body)
        self.statements(node.orelse)

    def attempt(self, node: ast.Try) -> None:
        """Allow an attempt; what it catches may be shown or raised again, like any data."""
        self.statements(node.body)
        for handler in node.handlers:
            if handler.name is not None and not self.is_data(handler.name):
                wild()
            kinds = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type]
            for kind in kinds:
                if kind is not None and not (isinstance(kind, ast.Name) and self.is_given(kind.id, ERRORS)):
                    wild()
            self.statements(handler.body)
        self.statements(node.orelse)
        self.statements(node.finalbody)

    def raised(self, node: ast.Raise) -> None:
        """Allow an error to be raised, with data."""
        for part in (node.exc, node.cause):
            match part:
                case ast.Name(name) if self.is_given(name, ERRORS):
                    pass
                case ast.Call(ast.Name(name), args, keywords) if self.is_given(name, ERRORS):
                    self.arguments(args, keywords)
                case ast.expr():
                    self.value(part)

    def parts(self, node: ast.AST) -> None:
        """Allow statements and expressions of which all parts are statements and data."""
        for name in node._fields:
            part = getattr(node, name)
            if type(part) is list:
                for each in part:
                    self.part(each)
            else:
                self.part(part)

    def part(self, part: Any) -> None:  # noqa: ANN401 - whatever a syntax tree holds
        """Allow a statement or an expression."""
        if isinstance(part, ast.expr):
            self.value(part)
        elif isinstance(part, ast.stmt):
            STATEMENTS.get(type(part), wild)(self, part)
        elif isinstance(part, ast.AST) and not isinstance(part, OPERATOR_NODES):
            wild()

    # --- expressions

    def value(self, node: ast.expr) -> None:
        """Allow an expression whose value is data."""
        VALUES.get(type(node), wild)(self, node)

    def consumed(self, node: ast.expr) -> None:
        """Allow an expression that is iterated over on the spot: data, or what can be iterated over once."""
        match node:
            case ast.GeneratorExp():
                self.comprehension(node)
            case ast.Call(ast.Name(name), args, keywords) if self.is_given(name, ITERATORS):
                if name in {"map", "filter"} and args:
                    self.callback(args[0])
                    args = args[1:]
                for each in args:
                    self.consumed(each)
                self.arguments((), keywords)
            case ast.Call(ast.Attribute(of, method), [], []) if method in VIEWS:
                self.value(of)
            case ast.Starred(inner):
                self.consumed(inner)
            case _:
                self.value(node)

    def callback(self, node: ast.expr) -> None:
        """Allow what a builtin calls on the spot: a function, a skill, a builtin, a method, a lambda."""
        match node:
            case ast.Lambda(args, body):
                if not self.special.isdisjoint(parameters_of(args)):
                    wild()
                self.parameters(args)
                self.value(body)
            case ast.Name(name) if self.is_own(name) or self.is_given(name, FUNCTIONS - {"next"}):
                pass
            case ast.Attribute(ast.Name("str"), method) if self.is_given("str", DATA_CLASSES):
                if method not in TEXT_METHODS:
                    wild()
            case ast.Attribute(of, "get" | "count" | "index"):
                self.value(of)
            case _:
                self.value(node)

    def call(self, node: ast.Call) -> None:
        """Allow a call whose result is data."""
        match node.func:
            case ast.Name(name) if self.is_own(name) or self.is_data(name):
                self.arguments(node.args, node.keywords)
            case ast.Name("isinstance") if self.is_given("isinstance", GIVEN):
                self.instance(node)
            case ast.Name(name) if self.is_given(name, FUNCTIONS):
                self.builtin(name, node)
            case ast.Attribute(ast.Name("time"), method) if not self.is_data("time"):
                if method not in CLOCK:
                    wild()
                self.arguments(node.args, node.keywords)
            case ast.Attribute(ast.Constant(str(text)), "format") if PLAIN_FIELDS.fullmatch(text):
                self.arguments(node.args, node.keywords)
            case ast.Attribute(of, method) if method in DATA_METHODS:
                self.value(of)
                self.method(method, node)
            case _:
                wild()

    def instance(self, node: ast.Call) -> None:
        """Allow `isinstance` with classes of data."""
        match node:
            case ast.Call(args=[thing, kinds], keywords=[]):
                self.value(thing)
            case _:
                wild()
        for kind in kinds.elts if isinstance(kinds, ast.Tuple) else [kinds]:
            if not (isinstance(kind, ast.Name) and self.is_given(kind.id, DATA_CLASSES)):
                wild()

    def builtin(self, name: str, node: ast.Call) -> None:
        """Allow the call of a builtin."""
        picks = name in {"max", "min"}  # one of several arguments is their result
        self.first_consumed(node.args, when=name in CONSUMERS and not (picks and len(node.args) > 1))
        self.keywords(node.keywords, calls=picks or name == "sorted")

    def method(self, method: str, node: ast.Call) -> None:
        """Allow the call of a method of data."""
        self.first_consumed(node.args, when=method in CONSUMING_METHODS)
        self.keywords(node.keywords, calls=method == "sort")

    def first_consumed(self, args: Sequence[ast.expr], *, when: bool) -> None:
        """Allow data as arguments; the first one may be used up on the spot, where it is."""
        for number, each in enumerate(args):
            if when and number == 0:
                self.consumed(each)
            else:
                self.argument(each)

    def arguments(self, args: Sequence[ast.expr], keywords: Sequence[ast.keyword]) -> None:
        """Allow data as arguments."""
        for each in args:
            self.argument(each)
        self.keywords(keywords, calls=False)

    def argument(self, node: ast.expr) -> None:
        """Allow data as an argument, or as several."""
        if type(node) is ast.Starred:
            self.consumed(node.value)
        else:
            self.value(node)

    def keywords(self, keywords: Sequence[ast.keyword], *, calls: bool) -> None:
        """Allow data by keyword, and `key` where it is called on the spot."""
        for keyword in keywords:
            if calls and keyword.arg == "key":
                self.callback(keyword.value)
            else:
                self.value(keyword.value)

    def display(self, node: ast.List | ast.Tuple) -> None:
        """Allow a list or a tuple, also where it is unpacked into."""
        for each in node.elts:
            self.argument(each)

    def comprehension(self, node: ast.ListComp | ast.DictComp | ast.GeneratorExp) -> None:
        """Allow a comprehension, in which no builtin's name stands for data."""
        for each in node.generators:
            for inner in ast.walk(each.target):
                if isinstance(inner, ast.Name) and inner.id in self.special:
                    wild()
            self.value(each.target)
            self.consumed(each.iter)
            for condition in each.ifs:
                self.value(condition)
            if each.is_async:
                wild()
        if isinstance(node, ast.DictComp):
            self.value(node.key)
            self.value(node.value)
        else:
            self.value(node.elt)

    def assignment(self, node: ast.NamedExpr) -> None:
        """Allow an assignment within an expression, whose scope may be another, to no builtin's name."""
        if node.target.id in self.special:
            wild()
        self.name(node.target)
        self.value(node.value)

    def comparison(self, node: ast.Compare) -> None:
        """Allow a comparison of data; what can be iterated over once may be searched."""
        sides = [node.left, *node.comparators]
        self.value(node.left)
        for operator, left, right in zip(node.ops, sides, sides[1:], strict=False):
            if isinstance(operator, ast.Is | ast.IsNot) and not (is_single(left) or is_single(right)):
                wild()
            if isinstance(operator, ast.In | ast.NotIn):
                self.consumed(right)
            else:
                self.value(right)

    def attribute(self, node: ast.Attribute) -> None:
        """Allow a part of a time to be read."""
        if node.attr not in PARTS_OF_TIME or type(node.ctx) is not ast.Load:
            wild()
        self.value(node.value)

    def constant(self, node: ast.Constant) -> None:
        """Allow a constant that is data."""
        if type(node.value) not in CONSTANTS:
            wild()

    def nothing(self, node: ast.AST) -> None:
        """Allow what has no parts that matter."""


@lru_cache(maxsize=16)
def special(skills: frozenset[str]) -> frozenset[str]:
    """The names that some program finds without binding them: those of builtins, modules and skills."""
    return skills | GIVEN | EXISTING


def wild(*_: object) -> NoReturn:
    """Say that something is not on the allowlist."""
    raise WildError


def is_single(node: ast.expr) -> bool:
    """Whether an expression is a constant of which there is one object only."""
    return isinstance(node, ast.Constant) and (node.value is None or type(node.value) is bool)


def parameters_of(given: ast.arguments) -> list[str]:
    """The names of the parameters of a function."""
    several = (*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg)
    return [arg.arg for arg in several if arg is not None]


def hidden_in(function: ast.FunctionDef) -> set[str]:
    """The names that a function binds by itself, and that hide others of the same name in all of it."""
    names = set(parameters_of(function.args))
    waiting: list[ast.AST] = list(function.body)
    while waiting:
        node = waiting.pop()
        kind = type(node)
        if kind is ast.Name:
            if type(node.ctx) is not ast.Load:  # type: ignore[attr-defined]  # by the line above
                names.add(node.id)  # type: ignore[attr-defined]  # the same
        elif kind is ast.ExceptHandler and node.name:  # type: ignore[attr-defined]  # the same
            names.add(node.name)  # type: ignore[attr-defined]  # the same
        if kind not in OWN_SCOPES:
            waiting.extend(ast.iter_child_nodes(node))
    return names


OPERATOR_NODES = (ast.operator, ast.boolop, ast.unaryop, ast.expr_context)
OWN_SCOPES = (ast.FunctionDef, ast.Lambda, ast.ListComp, ast.DictComp, ast.GeneratorExp)
STATEMENTS: dict[type[ast.AST], Callable[[Verifier, Any], None]] = {
    **dict.fromkeys(
        (ast.Expr, ast.Assign, ast.AugAssign, ast.While, ast.If, ast.Return, ast.Assert, ast.Delete),
        Verifier.parts,
    ),
    **dict.fromkeys((ast.Pass, ast.Break, ast.Continue), Verifier.nothing),
    **dict.fromkeys((ast.Global, ast.Nonlocal), Verifier.declaration),
    ast.AnnAssign: Verifier.annotated,
    ast.FunctionDef: Verifier.function,
    ast.Import: Verifier.imported,
    ast.For: Verifier.loop,
    ast.Try: Verifier.attempt,
    ast.Raise: Verifier.raised,
}
VALUES: dict[type[ast.AST], Callable[[Verifier, Any], None]] = {
    **dict.fromkeys(
        (ast.BoolOp, ast.BinOp, ast.UnaryOp, ast.IfExp, ast.Subscript, ast.Slice, ast.Dict), Verifier.parts
    ),
    **dict.fromkeys((ast.JoinedStr, ast.FormattedValue), Verifier.parts),
    **dict.fromkeys((ast.List, ast.Tuple), Verifier.display),
    **dict.fromkeys((ast.ListComp, ast.DictComp), Verifier.comprehension),
    ast.Name: Verifier.name,
    ast.Constant: Verifier.constant,
    ast.Call: Verifier.call,
    ast.Attribute: Verifier.attribute,
    ast.Compare: Verifier.comparison,
    ast.NamedExpr: Verifier.assignment,
}
