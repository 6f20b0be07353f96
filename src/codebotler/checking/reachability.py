"""Where errors of a program do no harm, as far as its text tells: in lines that never run, or are caught."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

from codebotler.core.program import TASK, Problem, parsed

EVERYTHING = frozenset({"Exception", "BaseException"})
ENDS = (ast.Return, ast.Raise, ast.Continue, ast.Break)


@dataclass(frozen=True)
class Reach:
    """Where errors of a program do no harm.

    Args:
        never: the lines that never run.
        caught: lines that stand in a `try` or `with`, with the kinds of errors that it may catch.
    """

    never: frozenset[int]
    caught: tuple[tuple[range, frozenset[str]], ...]

    def forgives(self, line: int | None, kind: str) -> bool:
        """Whether an error of some kind does no harm at a line, counted from 1."""
        if line is None or kind == "SyntaxError":
            return False
        catching = (kinds for lines, kinds in self.caught if line in lines)
        return line in self.never or any(kind in kinds or kinds & EVERYTHING for kinds in catching)


@lru_cache(maxsize=16)
def reach(source: str) -> Reach:
    """Where errors of a program do no harm; of one that does not parse, nowhere.

    Args:
        source: of the program.
    """
    tree = parsed(source)
    if isinstance(tree, Problem):
        return Reach(frozenset(), ())
    try:
        return Reach(
            frozenset(line for node in _never(tree) for line in _lines([node])), tuple(_caught(tree))
        )
    except RecursionError:
        return Reach(frozenset(), ())


def _never(tree: ast.Module) -> Iterator[ast.stmt]:
    """The statements that never run: behind a return, below what is never true, in what nobody calls."""
    named = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)} | {TASK}
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(name, body=body, decorator_list=[]) if name not in named:
                yield from body
            case ast.If(ast.Constant(value), body, orelse):
                yield from orelse if value else body
            case ast.While(ast.Constant(value), body) if not value:
                yield from body
        for block in ("body", "orelse", "finalbody"):
            statements = getattr(node, block, [])
            if isinstance(statements, list):
                yield from _behind_the_end(statements)


def _behind_the_end(statements: Sequence[ast.stmt]) -> Sequence[ast.stmt]:
    ends = next((i for i, statement in enumerate(statements) if isinstance(statement, ENDS)), len(statements))
    return statements[ends + 1 :]


def _caught(tree: ast.Module) -> Iterator[tuple[range, frozenset[str]]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Try | ast.TryStar) and node.handlers:
            yield _lines(node.body), frozenset().union(*map(_kinds, node.handlers))
        elif isinstance(node, ast.With):  # which may swallow anything
            yield _lines(node.body), EVERYTHING


def _kinds(handler: ast.ExceptHandler) -> frozenset[str]:
    """The names of the classes that a handler catches."""
    if handler.type is None:
        return EVERYTHING
    return frozenset(node.id for node in ast.walk(handler.type) if isinstance(node, ast.Name))


def _lines(statements: Sequence[ast.stmt]) -> range:
    return range(statements[0].lineno, (statements[-1].end_lineno or statements[-1].lineno) + 1)
