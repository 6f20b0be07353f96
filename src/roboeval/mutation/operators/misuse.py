"""Mutation operators for custom skills: wrong arguments, unhandled errors and missing steps."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from typing import Any

from codebotler.core.skills.declaration import by_name
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill
from roboeval.mutation.operator import Context, Edits
from roboeval.mutation.program_tree import ProgramTree, skill_of

OTHER_TYPE: dict[str, Any] = {"str": 3, "int": "three", "float": "0.5", "bool": "yes"}
NO_CHOICE: dict[str, Any] = {"str": "anything", "int": 1_000, "float": 1_000.5}


def pass_another_type(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that replaces an argument of a custom skill with a value of the wrong type."""
    for node, skill in _own_calls(program):
        for argument, parameter in zip(node.args, skill.parameters, strict=False):
            yield {argument: ast.Constant(OTHER_TYPE[parameter.type.base or "str"])}


def pass_no_choice(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that replaces an argument of a custom skill with a value that is not allowed."""
    for node, skill in _own_calls(program):
        for argument, parameter in zip(node.args, skill.parameters, strict=False):
            if parameter.type.choices:
                yield {argument: ast.Constant(NO_CHOICE[parameter.type.base or "str"])}


def forget_an_argument(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes the last argument from a call of a custom skill."""
    for node, _skill in _own_calls(program):
        if node.args:
            yield {node: ast.Call(node.func, node.args[:-1], node.keywords)}


def handle_no_error(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes the error handling (`try`) around a custom skill."""
    for node in program.nodes:
        if isinstance(node, ast.Try) and any(
            _is_own(inner) for part in node.body for inner in ast.walk(part)
        ):
            yield {node: [*node.body, *node.orelse, *node.finalbody]}


def skip_a_step(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that removes a call of a custom skill, on which later steps may depend."""
    return ({node: []} for node in program.nodes if isinstance(node, ast.Expr) and _is_own(node.value))


def take_a_step_again(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that calls a custom skill twice instead of once."""
    for node in program.nodes:
        if isinstance(node, ast.Expr) and _is_own(node.value):
            yield {node: [node, node]}


def ask_for_success_in_vain(program: ProgramTree, _: Context) -> Edits:
    """Yield each edit that makes the program ignore whether a custom skill succeeded."""
    for node in program.nodes:
        match node:
            case ast.If(test, body) if _is_own(test):
                yield {node: [ast.Expr(test), *body]}
            case ast.If(ast.UnaryOp(ast.Not(), test)) if _is_own(test):
                yield {node: ast.Expr(test)}


def _own_calls(program: ProgramTree) -> Iterator[tuple[ast.Call, Skill]]:
    for node in program.nodes:
        if isinstance(node, ast.Call) and _is_own(node):
            skill = by_name(skill_of(node) or "")
            assert skill is not None, "the called function must be a skill"
            yield node, skill


def _is_own(node: ast.AST) -> bool:
    return (name := skill_of(node)) is not None and name not in SKILLS
