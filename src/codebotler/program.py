"""What a model's reply means as a program, and what can be said against a program without running it."""

from __future__ import annotations

import ast
import keyword
import re
import symtable
import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from codebotler.skills import SKILLS, Parameter, Skill, SkillTable

TASK = "task_program"
GIVEN = ("time", "sys")  # modules that every program finds imported


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

    @classmethod
    def from_reply(cls, reply: str) -> Program:
        """The program that a model means by a whole reply.

        Whole lines are kept or dropped, and a reply that was cut off stays cut off: only what is plainly no
        code, and a next example that a base model ran on into, is left out.

        Args:
            reply: code with or without fences and prose, or the indented body of `task_program` alone.
        """
        lines = re.split(r"\r\n|\r|\n", reply)
        if _is_plain(lines):
            return cls(_text(lines))
        blocks = tuple(_blocks(lines))
        chosen = _choose(blocks)
        if chosen is None:
            return cls(reply)
        return cls(_with_definitions(chosen, blocks))

    def problems(self, skills: SkillTable = SKILLS) -> tuple[Problem, ...]:
        """What is certainly wrong, by line; nothing is run.

        Args:
            skills: what the program may call.
        """
        tree = _tree(self.source, compiled=True)
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


# --- reading a reply


@dataclass(frozen=True)
class _Block:
    """Lines of a reply that belong together as code.

    Args:
        lines: without the indentation they share.
        fenced: whether the reply marks them as code.
        headless: whether they are a body in front of which `def task_program():` was put.
    """

    lines: tuple[str, ...]
    fenced: bool
    headless: bool

    @property
    def defines_task(self) -> bool:
        """Whether the entry of a program stands in it, be it cut off afterwards."""
        return any(_ENTRY.match(line) for line in self.lines)


_ENTRY = re.compile(rf"(?:async\s+)?def\s+{TASK}\b|{TASK}\s*=(?!=)")
_FENCE = re.compile(r"(?P<indent>\s*)(?P<marks>`{3,}|~{3,})[^`]*$")
_CODE = re.compile(
    r"""\s*(?:
      \# | @\w | (?:async\s+)?def\s+\w+\s*\( | class\s+\w+\s*[(:] | import\s+\w | from\s+[\w.]+\s+import\b
    | [^\W\d][\w.]*\(                                                                       # a call
    | [^\W\d][\w.]*(?:\s*,\s*[^\W\d][\w.]*)*(?:\[[^\]]*\])?\s*
      (?::\s*[\w.]+(?:\[.*\])?\s*)?(?:[-+*/%|&^@]|//|\*\*|<<|>>)?=(?!=)                     # an assignment
    )""",
    re.VERBOSE,
)
_KEYWORDS = "|".join((*(word for word in keyword.kwlist if word.islower()), "match", "case", "print", "exec"))
_PROSE = re.compile(
    rf"""[ ]?(?:
      (?:[-*+>•\u2013]|\d+[.)])\s | \*\* | ` | [-=*_]{{3,}}\s*$ | </?[\w|] | [^\x00-\x7f]  # Markdown, tags
    | (?!(?:{_KEYWORDS})\b)[^\W\d_][\w'\u2019-]*(?:[,:;.!?]?\s+[\w`*“]|[:.!?…]+\s*$)        # words
    )""",
    re.VERBOSE,
)
_INTERJECTION = re.compile(r" ?[A-Z][a-z]+\s*$")


def _is_plain(lines: Sequence[str]) -> bool:
    """Whether a reply is a program as it stands."""
    source = "\n".join(lines)
    tree = _tree(source)
    return not isinstance(tree, Problem) and TASK in _bound(source) and len(_entries(tree)) <= 1


def _blocks(lines: Sequence[str]) -> Iterator[_Block]:
    """All code of a reply, in order: what stands in fences, and outside them what is no prose."""
    for fenced, part in _parts(lines):
        for run in _runs(part):
            headless = _headless(run)
            shaped = headless or _dedented(run)
            yield _Block(tuple(_without_next_example(shaped)), fenced, headless is not None)


def _parts(lines: Sequence[str]) -> Iterator[tuple[bool, list[str]]]:
    """The reply cut at its fences; the last fence need not be closed."""
    fence: re.Match[str] | None = None
    part: list[str] = []
    for line in lines:
        if fence is None and (opening := _FENCE.match(line)):
            yield False, part
            fence, part = opening, []
        elif fence is not None and _closes(fence["marks"], line.strip()):
            yield True, part
            fence, part = None, []
        else:
            part.append(line.removeprefix(fence["indent"]) if fence else line)
    yield fence is not None, part


def _closes(marks: str, line: str) -> bool:
    return line.startswith(marks) and not line.strip(marks[0])


def _runs(lines: Sequence[str]) -> Iterator[Sequence[str]]:
    """The stretches of lines between paragraphs of prose, without empty ones."""
    if not isinstance(_tree("\n".join(_headless(lines) or _dedented(lines))), Problem):
        if _code_of(lines):
            yield lines
        return
    run: list[str] = []
    in_prose = False
    for line in lines:
        in_prose = _goes_on(line) if in_prose else _is_prose(line)
        if not in_prose:
            run.append(line)
        elif run:
            if _code_of(run):
                yield run
            run = []
    if _code_of(run):
        yield run


def _is_prose(line: str) -> bool:
    """Whether a line can be nothing but prose; in doubt it is code, so that no code is ever lost."""
    if _INTERJECTION.match(line):
        return True
    return bool(_PROSE.match(line)) and not _CODE.match(line) and isinstance(_tree(line.strip()), Problem)


def _goes_on(line: str) -> bool:
    """Whether a paragraph of prose goes on with a line, which may look like anything in the middle of it."""
    return bool(line.strip()) and not _CODE.match(line)


def _headless(lines: Sequence[str]) -> list[str] | None:
    """The lines as the body of `task_program`, if they are one.

    A body may lack the indentation of its first line, because the prompt ended with it.
    """
    code = _code_of(lines)
    if not code or _is_prose(lines[code[0]].strip()):
        return None
    head = lines[code[0]]
    start = next((i for i in code if _ENTRY.match(lines[i].lstrip())), None)
    if _indent(head):
        if start is not None and len(_indent(lines[start])) >= len(_indent(head)):
            return None
        return [f"def {TASK}():", *lines]
    inner = code[1 : next((n for n, i in enumerate(code) if n and not _indent(lines[i])), None)]
    if not inner or start in (code[0], *inner) or _tree_is_fine(lines):
        return None
    margin = min((_indent(lines[i]) for i in inner), key=len)
    if head.rstrip()[-1] in ":([{,\\" and _indent(lines[inner[0]]) == margin:
        return None  # the indentation belongs to the first line's own block or bracket
    return [f"def {TASK}():", *lines[: code[0]], margin + head, *lines[code[0] + 1 :]]


def _tree_is_fine(lines: Sequence[str]) -> bool:
    return not isinstance(_tree("\n".join(lines)), Problem)


def _code_of(lines: Sequence[str]) -> list[int]:
    """Which lines are not blank."""
    return [i for i, line in enumerate(lines) if line.strip()]


def _indent(line: str) -> str:
    return line[: len(line) - len(line.lstrip())]


def _dedented(lines: Sequence[str]) -> list[str]:
    """The lines without the indentation of the first one; a line that lacks it stays as it is."""
    margin = next((_indent(line) for line in lines if line.strip()), "")
    return [line.removeprefix(margin) for line in lines]


def _without_next_example(lines: Sequence[str]) -> Sequence[str]:
    """The lines up to a second `def task_program` and the comment that introduces it."""
    tree = _tree("\n".join(lines))
    starts = [i for i, line in enumerate(lines) if _ENTRY.match(line) and "=" not in line.split("(", 1)[0]]
    if len(starts) <= 1 or (not isinstance(tree, Problem) and len(_entries(tree)) <= 1):
        return lines
    end = starts[1]
    while not lines[end - 1].strip() or lines[end - 1].startswith(("#", "@")):
        end -= 1
    return lines[:end]


def _choose(blocks: Sequence[_Block]) -> _Block | None:
    """The block that is the program: the first that defines it, or else one that could be meant as it."""
    for block in blocks:
        goes_on_from_prompt = block is blocks[0] and not block.fenced
        if block.defines_task and (goes_on_from_prompt or not block.headless):
            return block
    for block in blocks:
        if block.headless and any(_CODE.match(line) for line in block.lines[1:]):
            return block
    return next((block for block in blocks if block.fenced), None)


def _with_definitions(chosen: _Block, blocks: Sequence[_Block]) -> str:
    """The chosen block with the other blocks that define, at top level, what it lacks."""
    bound = [set() if block.defines_task else _bound("\n".join(block.lines)) for block in blocks]
    kept = {next(i for i, block in enumerate(blocks) if block is chosen)}
    while True:
        source = "\n\n\n".join(_text(blocks[i].lines).strip("\n") for i in sorted(kept)) + "\n"
        missing = _missing(source)
        before = len(kept)
        for i, names in enumerate(bound):
            if i not in kept and names & missing:
                kept.add(i)
                missing -= names
        if len(kept) == before:
            return source


def _missing(source: str) -> set[str]:
    """The names that a program uses and nothing defines; none can be told of one that does not parse."""
    tree = _tree(source)
    if isinstance(tree, Problem):
        return set()
    try:
        return {name for _, name, _ in _undefined(tree, SKILLS)}
    except (RecursionError, MemoryError):
        return set()


def _text(lines: Sequence[str]) -> str:
    """The lines as a text, without the blank ones at its ends."""
    code = _code_of(lines)
    return "\n".join(lines[code[0] : code[-1] + 1]) + "\n" if code else ""


# --- parsing


def _tree(source: str, *, compiled: bool = False) -> ast.Module | Problem:
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
        with warnings.catch_warnings(action="ignore"):
            tree = ast.parse(source)
            if compiled:
                compile(tree, "<program>", "exec", dont_inherit=True)
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
    return tree


def _too_deep(error: Exception) -> Problem:
    return Problem(None, type(error).__name__, "the program is nested too deeply to be checked")


def _entries(tree: ast.Module) -> list[ast.FunctionDef | ast.AsyncFunctionDef]:
    """The definitions of `task_program` that stand directly in the module."""
    return [
        node
        for node in tree.body
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name == TASK
    ]


def _bound(source: str) -> set[str]:
    """The names that a source defines or imports at module level; none if it does not parse."""
    if isinstance(_tree(source, compiled=True), Problem):
        return set()
    with warnings.catch_warnings(action="ignore"):
        table = symtable.symtable(source, "<program>", "exec")
    return {s.get_name() for s in table.get_symbols() if s.is_assigned() or s.is_imported()}


# --- static problems


def _entry_problems(tree: ast.Module, source: str) -> Iterator[Problem]:
    """Whether `task_program` is there and can be called without arguments."""
    if TASK not in _bound(source):
        yield Problem(None, "NameError", f"the program defines no {TASK} at module level")
    entries = _entries(tree)
    if not entries or entries[-1].decorator_list or TASK in _names_bound(tree, besides=entries):
        return
    given = entries[-1].args
    positional = [*given.posonlyargs, *given.args]
    required = positional[: len(positional) - len(given.defaults)]
    required += [a for a, default in zip(given.kwonlyargs, given.kw_defaults, strict=True) if default is None]
    if required:
        names = _listed([a.arg for a in required])
        yield Problem(
            entries[-1].lineno, "TypeError", f"{TASK} takes {names}, but it is called without arguments"
        )


def _name_problems(tree: ast.Module, skills: SkillTable) -> Iterator[Problem]:
    for line, name, is_local in _undefined(tree, skills):
        if is_local:
            yield Problem(
                line, "UnboundLocalError", f"the local variable {name} is used before it has a value"
            )
        else:
            yield Problem(line, "NameError", f"the name {name} is not defined")


def _undefined(tree: ast.Module, skills: SkillTable) -> list[tuple[int, str, bool]]:
    """The line and name of each use of an undefined name, and whether it is a local one used too early."""
    # Imported where it is used: it takes a tenth of a second, which every command line would pay.
    from pyflakes import messages  # type: ignore[import-untyped] # noqa: PLC0415
    from pyflakes.checker import Checker  # type: ignore[import-untyped] # noqa: PLC0415

    # Names in annotations that are texts are never looked up when a program runs.
    spelled = {(n.lineno, n.col_offset) for n in ast.walk(tree) if isinstance(n, ast.Name)}
    with warnings.catch_warnings(action="ignore"):
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
    rebound = _names_bound(tree)
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
    takes = f"{skill.name} takes {_listed(names) or 'no arguments'}"
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


def _names_bound(tree: ast.Module, besides: Iterable[ast.AST] = ()) -> set[str]:
    """The names that a program gives a meaning anywhere, in whatever scope."""
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


def _listed(names: Sequence[str]) -> str:
    """Names as one says them: `a, b and c`."""
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))
