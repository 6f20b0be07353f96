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

from codebotler.simulator.sandbox.tame_expressions import (
    ERRORS,
    ExpressionVerifier,
    WildError,
    parameters_of,
    wild,
)

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any, ClassVar

    from codebotler.simulator.sandbox.tame_expressions import Checks, Nodes

OWN_SCOPES = (ast.FunctionDef, ast.Lambda, ast.ListComp, ast.DictComp, ast.GeneratorExp)


def is_tame(tree: ast.Module, nodes: Nodes, skills: frozenset[str]) -> bool:
    """Return whether a program is tame.

    Args:
        tree: the program's syntax tree.
        nodes: all nodes of the tree by type.
        skills: the names of the skills that the program may call.
    """
    try:
        ProgramVerifier(nodes, skills).check_statements(tree.body)
    except (WildError, RecursionError):
        return False
    return True


class ProgramVerifier(ExpressionVerifier):
    """Raises WildError for a statement that is not allowed. `STATEMENTS` has a check per allowed kind."""

    def check_statements(self, body: Sequence[ast.stmt]) -> None:
        """Check a block of statements."""
        for node in body:
            self.STATEMENTS.get(type(node), wild)(self, node)

    def _check_part(self, part: object) -> None:
        if isinstance(part, ast.stmt):
            self.check_statements([part])
        else:
            super()._check_part(part)

    def _check_function(self, node: ast.FunctionDef) -> None:
        """Allow a function, which may use a special name for its own data."""
        if node.decorator_list or getattr(node, "type_params", None):
            wild()
        if node.returns is not None:
            self._check_annotation(node.returns)
        self._check_parameters(node.args)
        hides = not self.special.isdisjoint(self.bound)
        self.hidden.append(self.special & _names_bound_in(node) if hides else frozenset())
        self.check_statements(node.body)
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
        self._check_value(node.target)
        self._check_annotation(node.annotation)
        if node.value is not None:
            self._check_value(node.value)

    def _check_loop(self, node: ast.For) -> None:
        self._check_value(node.target)
        self._check_iterable(node.iter)
        self.check_statements([*node.body, *node.orelse])

    def _check_try(self, node: ast.Try) -> None:
        """Allow `try`. A caught error may be printed or raised again, like any data."""
        self.check_statements(node.body)
        for handler in node.handlers:
            if handler.name is not None and not self.is_data(handler.name):
                wild()
            kinds = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type]
            for kind in kinds:
                if kind is not None and not (isinstance(kind, ast.Name) and self._is_given(kind.id, ERRORS)):
                    wild()
            self.check_statements(handler.body)
        self.check_statements([*node.orelse, *node.finalbody])

    def _check_raise(self, node: ast.Raise) -> None:
        for part in (node.exc, node.cause):
            match part:
                case ast.Name(name) if self._is_given(name, ERRORS):
                    pass
                case ast.Call(ast.Name(name), args, keywords) if self._is_given(name, ERRORS):
                    self._check_arguments(args, keywords)
                case ast.expr():
                    self._check_value(part)

    STATEMENTS: ClassVar[Checks] = {
        **dict.fromkeys((ast.Expr, ast.Assign, ast.AugAssign, ast.While), ExpressionVerifier.check_parts),
        **dict.fromkeys(
            (ast.If, ast.Return, ast.Assert, ast.Delete, ast.Pass, ast.Break, ast.Continue),
            ExpressionVerifier.check_parts,
        ),
        **dict.fromkeys((ast.Global, ast.Nonlocal), _check_declaration),
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
