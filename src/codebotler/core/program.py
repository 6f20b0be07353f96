"""Robot programs, and what can be said against one without running it."""

from __future__ import annotations

import ast
import builtins
import symtable
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from codebotler.core.skills import SKILLS, Parameter, Skill, SkillTable
from codebotler.core.syntaxtree import parse, reading
from codebotler.core.words import counted, listed

TASK = "task_program"
GIVEN = ("time", "sys")  # modules that every program finds imported
NOT_IN_A_RUN = frozenset({"help", "copyright", "credits", "license", "WindowsError", "__file__"})


@dataclass(frozen=True)
class Problem:
    """Something that is certainly wrong with a program.

    Args:
        line: where, counted from 1; None where no line is to blame.
        kind: the failure it leads to when a run gets there, such as `NameError` or `AskEmptyOptions`.
        message: what is wrong, in one plain sentence.
    """

    line: int | None
    kind: str
    message: str


@dataclass(frozen=True)
class Program:
    """Python source that should define `task_program`.

    Args:
        source: its text; any text is allowed, and `problems` says what is wrong with it.
    """

    source: str

    def __repr__(self) -> str:
        return f"Program({counted(len(self.source.splitlines()), 'line')})"

    def problems(self, skills: SkillTable = SKILLS) -> tuple[Problem, ...]:
        """What is certainly wrong, by line; nothing is run.

        Args:
            skills: what the program may call.
        """
        tree = parsed(self.source, compiled=True)
        if isinstance(tree, Problem):
            return (tree,)
        try:
            found = [
                *_entry_problems(tree, self.source),
                *_name_problems(tree, skills),
                *_call_problems(tree, skills),
            ]
        except (RecursionError, MemoryError) as error:
            found = [_too_deep(error)]
        return tuple(sorted(dict.fromkeys(found), key=lambda problem: problem.line or 0))


# --- parsing


def parsed(source: str, *, compiled: bool = False) -> ast.Module | Problem:
    """The syntax tree of a source, or why there is none.

    CPython bounds the depth of its own parser and compiler (tried up to 1 MB of brackets, signs, lambdas,
    attributes and blocks under 3.11), so that hostile nesting ends in an exception and needs no check before.

    Args:
        source: any text.
        compiled: whether to look also for errors that the compiler finds, such as a stray `return`.
    """
    if "\0" in source:
        line = source[: source.index("\0")].count("\n") + 1
        return Problem(line, "SyntaxError", "the program holds a null character")
    try:
        return parse(source, compiled=compiled)
    except SyntaxError as error:
        message = f"the program does not parse: {error.msg}"
        return Problem(error.lineno or None, type(error).__name__, message)
    except UnicodeEncodeError as error:
        line = source[: error.start].count("\n") + 1
        return Problem(
            line, type(error).__name__, "the program holds half a character, which cannot be encoded"
        )
    except (RecursionError, MemoryError) as error:
        return _too_deep(error)
    except (ValueError, OverflowError, SystemError) as error:
        return Problem(None, type(error).__name__, f"the program cannot be read: {error}")


def _too_deep(error: Exception) -> Problem:
    return Problem(None, type(error).__name__, "the program is nested too deeply to be checked")


def entries(tree: ast.Module) -> list[ast.FunctionDef | ast.AsyncFunctionDef]:
    """The definitions of `task_program` that stand directly in the module."""
    return [
        node
        for node in tree.body
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name == TASK
    ]


def bound_names(source: str) -> set[str]:
    """The names that a source defines or imports at module level; none if it does not parse."""
    if isinstance(parsed(source, compiled=True), Problem):
        return set()
    with reading():
        table = symtable.symtable(source, "<program>", "exec")
    return {s.get_name() for s in table.get_symbols() if s.is_assigned() or s.is_imported()}


def called_skills(source: str, skills: SkillTable = SKILLS) -> dict[str, int]:
    """The skills that a source calls, each with the first line; none if it does not parse.

    Args:
        source: of a program.
        skills: what it may call; a name that it gives a meaning of its own is no skill.
    """
    tree = parsed(source)
    if isinstance(tree, Problem):
        return {}
    rebound = names_bound(tree)
    lines: dict[str, int] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id in skills and node.id not in rebound:
            lines[node.id] = min(node.lineno, lines.get(node.id, node.lineno))
    return lines


# --- static problems


def _entry_problems(tree: ast.Module, source: str) -> Iterator[Problem]:
    """Whether `task_program` is there and can be called without arguments."""
    if TASK not in bound_names(source):
        yield Problem(None, "NameError", f"the program defines no {TASK} at module level")
    found = entries(tree)
    if not found or found[-1].decorator_list or TASK in names_bound(tree, besides=found):
        return
    if isinstance(found[-1], ast.AsyncFunctionDef) and not _may_begin(tree, found[-1]):
        yield Problem(found[-1].lineno, "TypeError", f"{TASK} is a coroutine, which nobody awaits")
    given = found[-1].args
    positional = [*given.posonlyargs, *given.args]
    required = positional[: len(positional) - len(given.defaults)]
    required += [a for a, default in zip(given.kwonlyargs, given.kw_defaults, strict=True) if default is None]
    if required:
        names = listed([a.arg for a in required])
        yield Problem(
            found[-1].lineno, "TypeError", f"{TASK} takes {names}, but it is called without arguments"
        )


def _may_begin(tree: ast.Module, task: ast.AsyncFunctionDef) -> bool:
    """Whether something names a coroutine that may then begin it, or it is an asynchronous generator."""
    names = (node.id for node in ast.walk(tree) if isinstance(node, ast.Name))
    return TASK in names or any(isinstance(node, ast.Yield) for node in ast.walk(task))


def _name_problems(tree: ast.Module, skills: SkillTable) -> Iterator[Problem]:
    for line, name, is_local in [*undefined_names(tree, skills), *_missing_here(tree, skills)]:
        if is_local:
            yield Problem(
                line, "UnboundLocalError", f"the local variable {name} is used before it has a value"
            )
        else:
            yield Problem(line, "NameError", f"the name {name} is not defined")


def _missing_here(tree: ast.Module, skills: SkillTable) -> Iterator[tuple[int, str, bool]]:
    """What pyflakes takes for defined, and is not: names of a console, and those only declared global."""
    bound = names_bound(tree)
    if "*" in bound:
        return
    declared = {name for node in ast.walk(tree) if isinstance(node, ast.Global) for name in node.names}
    missing = (NOT_IN_A_RUN | (declared - {*dir(builtins), *skills, *GIVEN})) - bound
    for node in ast.walk(tree):
        match node:
            case ast.Name(name, ast.Load()) if name in missing:
                yield node.lineno, name, False


def undefined_names(tree: ast.Module, skills: SkillTable) -> list[tuple[int, str, bool]]:
    """The line and name of each use of an undefined name, and whether it is a local one used too early."""
    # Imported where it is used: it takes a tenth of a second, which every command line would pay.
    from pyflakes import messages  # type: ignore[import-untyped] # noqa: PLC0415 - see above
    from pyflakes.checker import Checker  # type: ignore[import-untyped] # noqa: PLC0415 - the same

    # Names in annotations that are texts are never looked up when a program runs.
    spelled = {(n.lineno, n.col_offset) for n in ast.walk(tree) if isinstance(n, ast.Name)}
    with reading():
        found = Checker(tree, builtins={*skills, *GIVEN}, withDoctest=False).messages
    return [
        # pyflakes gives the bare name, not a tuple, where a local variable hides something built in
        (m.lineno, m.message_args if isinstance(m.message_args, str) else m.message_args[0], is_local)
        for m in found
        for is_local in [isinstance(m, messages.UndefinedLocal)]
        if (is_local or isinstance(m, messages.UndefinedName)) and (m.lineno, m.col) in spelled
    ]


def _call_problems(tree: ast.Module, skills: SkillTable) -> Iterator[Problem]:
    """The calls of skills that cannot succeed; a name that it gives a meaning of its own is no skill."""
    rebound = names_bound(tree)
    if "*" in rebound:
        return
    for node in ast.walk(tree):
        match node:
            case ast.Call(ast.Name(name)) if name in skills and name not in rebound:
                yield from _wrong_call(node, skills[name])


def _wrong_call(node: ast.Call, skill: Skill) -> Iterator[Problem]:
    is_open = any(isinstance(a, ast.Starred) for a in node.args) or any(k.arg is None for k in node.keywords)
    message = None if is_open else _mismatch(node, skill)
    if message:
        yield Problem(node.lineno, "TypeError", message)
        return
    given = dict(zip((p.name for p in skill.parameters), _leading(node.args), strict=False))
    given |= {k.arg: k.value for k in node.keywords if k.arg}
    for parameter in skill.parameters:
        if parameter.type is list and parameter.name in given:
            yield from _wrong_options(given[parameter.name], skill, parameter)


def _mismatch(node: ast.Call, skill: Skill) -> str | None:
    """Why the arguments do not fit the skill's parameters, in a sentence."""
    names = [p.name for p in skill.parameters]
    takes = f"{skill.name} takes {listed(names) or 'no arguments'}"
    keywords = [k.arg for k in node.keywords if k.arg]
    for word in keywords:
        if word not in names:
            return f"{takes}, but an argument named {word} is given"
        if word in names[: len(node.args)]:
            return f"{takes}, but {word} is given twice"
    count = len(node.args) + len(keywords)
    if count == len(names):
        return None
    return f"{takes}, but {count or 'no'} argument{'s are' if count > 1 else ' is'} given"


def _leading(arguments: Sequence[ast.expr]) -> Iterator[ast.expr]:
    """The arguments whose place is known: those before the first `*args`."""
    for argument in arguments:
        if isinstance(argument, ast.Starred):
            return
        yield argument


def _wrong_options(node: ast.expr, skill: Skill, parameter: Parameter) -> Iterator[Problem]:
    if isinstance(node, ast.List):
        if not node.elts:
            yield Problem(
                node.lineno, "AskEmptyOptions", f"the {parameter.name} of {skill.name} are an empty list"
            )
        for element in node.elts:
            if what := _literal(element, wanted="a string"):
                yield Problem(
                    element.lineno,
                    "AskInvalidOptions",
                    f"the {parameter.name} of {skill.name} must be strings, but {what} is among them",
                )
    elif what := _literal(node, wanted="a list"):
        yield Problem(
            node.lineno,
            "TypeError",
            f"the {parameter.name} of {skill.name} must be a list, but {what} is given",
        )


_LITERALS: dict[type[ast.expr], str] = {
    ast.Tuple: "a tuple",
    ast.Dict: "a dictionary",
    ast.DictComp: "a dictionary",
    ast.Set: "a set",
    ast.SetComp: "a set",
    ast.GeneratorExp: "a generator",
    ast.JoinedStr: "a string",
    ast.List: "a list",
    ast.ListComp: "a list",
    ast.Lambda: "a function",
}


def _literal(node: ast.expr, *, wanted: str) -> str | None:
    """What a literal is, unless it is of the type that is wanted; None also for what is no literal."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        node = node.operand
    if isinstance(node, ast.Constant):
        what = "a string" if isinstance(node.value, str) else f"the value {node.value!r:.40}"
    else:
        what = _LITERALS.get(type(node), "")
    return what if what and what != wanted else None


def names_bound(tree: ast.Module, besides: Iterable[ast.AST] = ()) -> set[str]:
    """The names that a program gives a meaning anywhere, in whatever scope; `*` where nobody can tell."""
    names: set[str] = set()
    skipped = {id(node) for node in besides}
    for node in ast.walk(tree):
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
