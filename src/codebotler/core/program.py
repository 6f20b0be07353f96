"""Parse programs, list the skills they call, and find mistakes such as undefined names.

CPython 3.11 parses some texts in quadratic time, so the length of programs is limited. The compiler,
`symtable` and pyflakes may still take any time, so apply them to untrusted text only in isolated processes
(`codebotler.simulator.process.isolated_call`).
"""

from __future__ import annotations

import ast
import builtins
import os
import symtable
import threading
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import lru_cache
from inspect import Parameter as Argument
from inspect import Signature
from itertools import islice
from typing import Any

from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Parameter, Skill, SkillTable
from codebotler.core.text.unicode import MAX_ACCENTS, compose, long_rows
from codebotler.core.text.words import counted, listed

TASK_FUNCTION = "task_program"
MAX_PROGRAM_LENGTH = 20_000  # characters, which take at most a tenth of a second to parse
MAX_KNOWN_NAMES, MAX_MISSPELT_LENGTH, MAX_HINTS = 1_000, 60, 10  # limits of hints about misspelt names
NAME_CUTOFF = 0.65  # the minimum similarity of a suggested name, from 0 to 1
GIVEN_MODULES = ("time", "sys")  # modules that every program can use without an import
SOURCE_NAME = "<program>"
NO_LISTS = (ast.Constant, ast.Tuple, ast.Dict, ast.Set, ast.GeneratorExp, ast.JoinedStr)

warnings.filterwarnings("ignore", module=SOURCE_NAME)  # about invalid escapes such as "\d" in programs

# CPython before 3.13 counts the nesting depth of all threads together, so if two threads parse at the same
# time, one gets a SystemError. A forked process must not inherit a locked lock.
_PARSING = threading.Lock()
os.register_at_fork(
    before=_PARSING.acquire, after_in_parent=_PARSING.release, after_in_child=_PARSING.release
)


@dataclass(frozen=True)
class Flaw:
    """A mistake that can be found without running the program, such as an undefined name."""

    line: int | None  # counted from 1; None if no single line is at fault
    kind: str  # the kind of error that it causes, such as `NameError` or `AskEmptyOptions`
    message: str  # one plain sentence
    is_misuse: bool = False  # whether it misuses a skill, which a broad `except` hides but does not fix


@dataclass(frozen=True)
class Program:
    """Python source that should define `task_program`, although any text is allowed."""

    source: str

    def __repr__(self) -> str:
        return f"Program({counted(len(self.source.splitlines()), 'line')})"


# --- parsing


@lru_cache(maxsize=8)
def parse(source: str) -> ast.Module:
    """Parse a program. Raise the same errors as `ast.parse`. Do not modify the tree: callers share it."""
    _expect_short_rows(source)
    with _PARSING:
        try:
            return ast.parse(compose(source), SOURCE_NAME)
        except SystemError:  # a library has parsed something in another thread
            return ast.parse(compose(source), SOURCE_NAME)


@lru_cache(maxsize=8)
def nodes(tree: ast.Module) -> tuple[ast.AST, ...]:
    """Return all nodes of a program's tree, in the order of `ast.walk`."""
    return tuple(ast.walk(tree))


def parse_expression(source: str) -> ast.expr:
    """Return the syntax tree of an expression. Raise the same errors as `ast.parse`."""
    _expect_short_rows(source)
    with _PARSING:
        return ast.parse(source, SOURCE_NAME, mode="eval").body


def _expect_short_rows(source: str) -> None:
    """Raise SyntaxError if a letter has too many accents, since `ast.parse` also normalizes names."""
    for start, _ in long_rows(source):
        line = source.count("\n", 0, start) + 1
        raise SyntaxError(f"a letter has more than {MAX_ACCENTS} accents", (SOURCE_NAME, line, None, None))


def parse_program(source: str, *, compiled: bool = False) -> ast.Module | Flaw:
    """Parse a program and return its syntax tree, or the flaw that prevents parsing.

    With `compiled`, also find compile-time errors, such as a stray `return`. For untrusted text, do this only
    in an isolated process.
    """
    if "\0" in source or len(source) > MAX_PROGRAM_LENGTH:
        return _text_flaw(source)
    try:
        tree = parse(source)
        if compiled:
            with _PARSING:
                compile(tree, SOURCE_NAME, "exec", dont_inherit=True)
    except SyntaxError as error:
        return Flaw(error.lineno or None, type(error).__name__, f"the program does not parse: {error.msg}")
    except UnicodeEncodeError as error:
        line = source[: error.start].count("\n") + 1
        return Flaw(line, type(error).__name__, "the program contains a lone surrogate")
    except (RecursionError, MemoryError) as error:
        return _nesting_flaw(error)
    except (ValueError, OverflowError, SystemError) as error:
        return Flaw(None, type(error).__name__, f"the program cannot be read: {error}")
    return tree


def _text_flaw(source: str) -> Flaw:
    if len(source) > MAX_PROGRAM_LENGTH:
        return Flaw(None, "MemoryError", f"the program is longer than {MAX_PROGRAM_LENGTH:,} characters")
    line = source[: source.index("\0")].count("\n") + 1
    return Flaw(line, "SyntaxError", "the program contains a null character")


def literal(node: ast.expr) -> Any:  # noqa: ANN401 - texts, numbers, booleans, lists of them
    """Return the value of a literal, such as `["yes", "no"]`. Raise ValueError for other nodes.

    Also reject dictionaries and sets, since hash collisions can make them slow to build.
    """
    try:
        if not any(isinstance(part, ast.Dict | ast.Set) for part in ast.walk(node)):
            return ast.literal_eval(node)
    except (TypeError, SyntaxError, MemoryError, RecursionError) as error:
        raise ValueError(str(error)) from None
    raise ValueError("the value contains a dictionary or a set; use a list")


def parse_leniently(source: str) -> ast.Module:
    """Return the syntax tree of a program, or an empty tree if it does not parse."""
    tree = parse_program(source)
    return ast.Module([], []) if isinstance(tree, Flaw) else tree


def _nesting_flaw(error: Exception) -> Flaw:
    return Flaw(None, type(error).__name__, "the program is nested too deeply to be checked")


# --- what a program defines and calls


def task_definitions(tree: ast.Module) -> list[ast.FunctionDef | ast.AsyncFunctionDef]:
    """Return the definitions of `task_program` at module level."""
    functions = (node for node in tree.body if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))
    return [function for function in functions if function.name == TASK_FUNCTION]


def module_bound_names(source: str) -> set[str]:
    """Return the names that a program binds at module level, or an empty set if it does not compile."""
    return set() if isinstance(parse_program(source, compiled=True), Flaw) else _bound_in_module(source)


def _bound_in_module(source: str) -> set[str]:
    with _PARSING:
        symbols = symtable.symtable(source, SOURCE_NAME, "exec").get_symbols()
    return {s.get_name() for s in symbols if s.is_assigned() or s.is_imported()}


def all_bound_names(tree: ast.Module, ignoring: Iterable[ast.AST] = ()) -> set[str]:
    """Return the names that a program binds in any scope (`*` for `from x import *`), skipping `ignoring`."""
    names: set[str] = set()
    skipped = {id(node) for node in ignoring}
    for node in nodes(tree):
        if id(node) in skipped:
            continue
        match node:
            case ast.Name(name, ast.Store() | ast.Del()) | ast.arg(name) | ast.MatchMapping(rest=str(name)):
                names.add(name)
            case ast.FunctionDef(name) | ast.AsyncFunctionDef(name) | ast.ClassDef(name):
                names.add(name)
            case ast.ExceptHandler(name=str(name)) | ast.MatchAs(name=str(name)) | ast.MatchStar(str(name)):
                names.add(name)
            case ast.alias(name, asname):
                names.add(asname or name.split(".", 1)[0])
    return names


def called_skills(tree: ast.Module, skills: SkillTable = SKILLS) -> dict[str, int]:
    """Return the line of each skill's first use, by name. Skip skills that the program redefines."""
    rebound = all_bound_names(tree)
    lines: dict[str, int] = {}
    for node in nodes(tree):
        if isinstance(node, ast.Name) and node.id in skills and node.id not in rebound:
            lines[node.id] = min(node.lineno, lines.get(node.id, node.lineno))
    return lines


def undefined_names(tree: ast.Module, skills: SkillTable) -> list[tuple[int, str, bool]]:
    """Return the line of each undefined name, the name, and whether it is a local used before assignment."""
    from pyflakes import messages  # type: ignore[import-untyped] # noqa: PLC0415 - takes a tenth of a second
    from pyflakes.checker import Checker  # type: ignore[import-untyped] # noqa: PLC0415 - slow

    class NameChecker(Checker):  # type: ignore[misc]  # pyflakes has no types
        def handleStringAnnotation(self, *_: object) -> None:  # noqa: N802 - a method of pyflakes
            """Ignore names in string annotations, since Python never looks them up."""

    with _PARSING:
        found = NameChecker(tree, builtins={*skills, *GIVEN_MODULES}, withDoctest=False).messages
    return [
        # pyflakes gives the bare name, not a tuple, where a local variable hides a builtin
        (m.lineno, m.message_args if isinstance(m.message_args, str) else m.message_args[0], is_local)
        for m in found
        for is_local in [isinstance(m, messages.UndefinedLocal)]
        if is_local or isinstance(m, messages.UndefinedName)
    ]


# --- definite errors


def find_tree_flaws(tree: ast.Module, source: str, skills: SkillTable) -> tuple[Flaw, ...]:
    """Return the mistakes in a program that compiles, such as misspelt skills, sorted by line."""
    try:
        found = [*_entry_flaws(tree, source), *_name_flaws(tree, skills), *_call_flaws(tree, skills)]
    except (RecursionError, MemoryError) as error:
        found = [_nesting_flaw(error)]
    return tuple(sorted(dict.fromkeys(found), key=lambda flaw: flaw.line or 0))


def _entry_flaws(tree: ast.Module, source: str) -> Iterator[Flaw]:
    if TASK_FUNCTION not in _bound_in_module(source):
        yield Flaw(None, "NameError", f"the program defines no {TASK_FUNCTION} at module level")
    found = task_definitions(tree)
    if not found or found[-1].decorator_list or TASK_FUNCTION in all_bound_names(tree, ignoring=found):
        return
    entry = found[-1]
    if isinstance(entry, ast.AsyncFunctionDef):
        yield Flaw(entry.lineno, "TypeError", f"{TASK_FUNCTION} is a coroutine, which is never awaited")
    given = entry.args
    positional = [*given.posonlyargs, *given.args]
    required = positional[: len(positional) - len(given.defaults)]
    required += [a for a, default in zip(given.kwonlyargs, given.kw_defaults, strict=True) if default is None]
    if required:
        names = listed([a.arg for a in required])
        message = f"{TASK_FUNCTION} takes {names}, but it is called without arguments"
        yield Flaw(entry.lineno, "TypeError", message)


def _name_flaws(tree: ast.Module, skills: SkillTable) -> Iterator[Flaw]:
    undefined = undefined_names(tree, skills)
    unknown_names = dict.fromkeys(name for _, name, is_local in undefined if not is_local)
    hints = _suggest_names(tree, unknown_names, skills)
    called = {n.func.id for n in nodes(tree) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)}
    for line, name, is_local in undefined:
        if is_local:
            yield Flaw(line, "UnboundLocalError", f"the local variable {name} is used before it has a value")
        else:
            hint = f"; did you mean {hints[name]}?" if name in hints else ""
            if not hint and name in called:
                hint = "; if it is a skill of your own, name its file with --skills"
            unknown = f"the name {name} is not defined{hint}"
            message = f"this robot has no `{name}` skill" if name in SKILLS else unknown
            yield Flaw(line, "NameError", message, is_misuse=name in called)


def _suggest_names(tree: ast.Module, undefined: Iterable[str], skills: SkillTable) -> dict[str, str]:
    """Suggest known names for undefined ones, within limits that keep this fast."""
    known = sorted({*all_bound_names(tree), *skills, *GIVEN_MODULES, *dir(builtins)})
    found: dict[str, str] = {}
    if len(known) > MAX_KNOWN_NAMES:
        return found
    for name in islice((one for one in undefined if len(one) <= MAX_MISSPELT_LENGTH), MAX_HINTS):
        alike = get_close_matches(name, (other for other in known if other != name), n=1, cutoff=NAME_CUTOFF)
        if alike:
            found[name] = alike[0]
    return found


def _call_flaws(tree: ast.Module, skills: SkillTable) -> Iterator[Flaw]:
    rebound = all_bound_names(tree)
    if "*" in rebound:
        return
    for node in nodes(tree):
        match node:
            case ast.Call(ast.Name(name)) if name in skills and name not in rebound:
                is_own = name not in SKILLS
                yield from (replace(flaw, is_misuse=is_own) for flaw in _check_call(node, skills[name]))


def _check_call(node: ast.Call, skill: Skill) -> Iterator[Flaw]:
    if any(isinstance(a, ast.Starred) for a in node.args) or any(k.arg is None for k in node.keywords):
        return
    takes = Signature([Argument(p.name, Argument.POSITIONAL_OR_KEYWORD) for p in skill.parameters])
    try:
        given = takes.bind(*node.args, **{k.arg: k.value for k in node.keywords if k.arg}).arguments
    except TypeError as error:
        yield Flaw(node.lineno, "TypeError", f"wrong call of {skill.signature}: {error}")
        return
    for parameter in skill.parameters:
        if parameter.is_options:
            yield from _check_options(given[parameter.name], skill, parameter)
        elif skill.name not in SKILLS:
            yield from _check_value(given[parameter.name], skill, parameter)


def _check_value(node: ast.expr, skill: Skill, parameter: Parameter) -> Iterator[Flaw]:
    try:
        value = ast.literal_eval(node)
    except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError):
        return
    if type(value) is tuple or not parameter.type.fits(value):
        is_choice = type(value).__name__ == parameter.type.base and not parameter.type.is_list
        message = f"{skill.name}: {parameter.name} must be {parameter.in_words}, not {value!r:.60}"
        yield Flaw(node.lineno, "ValueError" if is_choice else "TypeError", message)


def _check_options(node: ast.expr, skill: Skill, parameter: Parameter) -> Iterator[Flaw]:
    what = f"the {parameter.name} of {skill.name}"
    if isinstance(node, NO_LISTS):
        yield Flaw(node.lineno, "TypeError", f'{what} must be a list, such as ["yes", "no"]')
    elif isinstance(node, ast.List) and not node.elts:
        yield Flaw(node.lineno, "AskEmptyOptions", f"{what} are an empty list")
