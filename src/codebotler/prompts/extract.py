"""Extracts the program from a model's reply, without fixing or completing it."""

from __future__ import annotations

import ast
import keyword
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

from codebotler.core.program import TASK, Flaw, Program, bound_names, entries, parsed, undefined_names
from codebotler.core.skills.paper import SKILLS
from codebotler.simulator.isolated_call import IsolatedCallError, isolated

HELPER_ROUNDS = 20  # helpers of helpers, of which a reply to one instruction has two or three


@dataclass(frozen=True)
class ReplyContent:
    """What a model's reply holds.

    Args:
        program: the text of the program; the rest of the reply where there is none.
        reasoning: what the model thought aloud between markers; empty where it did not.
        has_code: whether any of it, thoughts aside, may be code; False is certain.
    """

    program: str
    reasoning: str
    has_code: bool


def read_reply(reply: str, *, continues: bool = False) -> ReplyContent:
    """Find the program, the reasoning and any code in a model's whole reply; see `program_of`.

    Raises:
        EngineError: no isolated process can be started.
    """
    try:
        return ReplyContent(*extract(reply, continues))
    except IsolatedCallError:
        return ReplyContent(reply, "", has_code=True)


def program_of(reply: str, *, continues: bool = False) -> Program:
    """The program in a model's whole reply.

    Of several versions, the last complete one counts. Thoughts between markers such as `<think>` and
    `</think>` are left out. Whole lines are kept or dropped: only what is certainly no code is dropped. A
    program that was cut off stays cut off.

    Args:
        reply: code with or without fences and prose, or the indented body of `task_program` alone. One that
            takes seconds to read is taken for the program as it is.
        continues: whether a base model wrote it, which goes on from the prompt: then the first version
            counts, and a next example that follows it is dropped.

    Raises:
        EngineError: no isolated process can be started.
    """
    return Program(read_reply(reply, continues=continues).program)


def program_in(text: str) -> str:
    """Find the program in a text that may be one, or a model's reply; see `program_of`.

    Args:
        text: a program that defines `task_program`, in whatever way, stays as it is.
    """
    try:
        return text if defines_task(text) else program_of(text).source
    except IsolatedCallError:
        return text


@isolated("def task_program():\n    say('hello')\n")
def defines_task(text: str) -> bool:
    """Whether a text compiles and binds `task_program` at module level."""
    return TASK in bound_names(text)


@isolated(
    "Here it is:\n```python\ndef task_program():\n    greet()\n```\n```\ndef greet():\n    say('hello')\n```"
)
def extract(reply: str, continues: bool = False) -> tuple[str, str, bool]:
    """The text of the program in a reply, the reasoning, and whether there is any code."""
    lines = re.split(r"\r\n|\r|\n", reply)
    tree = _tree(lines)
    if tree is not None and len(entries(tree)) <= 1 and TASK in bound_names("\n".join(lines)):
        return _joined([lines]), "", True
    answer, reasoning = _without_thoughts("\n".join(lines))
    blocks = [*_blocks(answer.split("\n"))]
    chosen = _chosen(blocks)
    program = answer if chosen is None else _with_helpers(chosen, blocks)
    return program, reasoning, bool(blocks)


@dataclass(frozen=True, eq=False)
class _Block:
    """Lines of a reply that belong together as code."""

    lines: Sequence[str]  # without the indentation they share
    tree: ast.Module | None  # None if they do not parse
    fenced: bool
    headless: bool  # a body, in front of which `def task_program():` was put

    @property
    def defines_task(self) -> bool:
        return any(_ENTRY.match(line) for line in self.lines)

    @property
    def is_outline(self) -> bool:
        """Whether its program is nothing but a docstring, `...` or `pass`."""
        return self.tree is not None and any(all(map(_is_idle, e.body)) for e in entries(self.tree))


_ENTRY = re.compile(rf"(?:async\s+)?def\s+{TASK}\b|{TASK}\s*=(?!=)")
_ASIDE = re.compile(
    r"""(?imsx)
      ^[ \t]* (?P<fence>`{3,}|~{3,}) [^`\n]*$ .*? (?: ^[ \t]* (?P=fence) [`~]* [ \t]*$ | \Z)
    | ^[ \t]* (?P<thought> <think(?:ing)?> (?:
        .*? (?: ^[ \t]* </think(?:ing)?> | </think(?:ing)?> [ \t]*$ ) | .*? </think(?:ing)?> | .* )) [ \t]*\n*
    | (?P<end> </think(?:ing)?> ) [ \t]* (?: \n+ | \Z )                   # of what the prompt began
    """
)
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


def _without_thoughts(reply: str) -> tuple[str, str]:
    """The reply without thoughts, and these; tags in a fence are code, unless the fence is in a thought."""
    kept = ""
    thoughts = []
    start = 0
    for found in _ASIDE.finditer(reply):
        if found["thought"]:
            kept += reply[start : found.start()]
            thoughts.append(re.sub(r"(?i)</?think(?:ing)?>", "", found["thought"]).strip())
        elif not found["end"] or start:
            continue
        else:
            thoughts.append(reply[: found.start()].strip())
        start = found.end()
    return kept + reply[start:], "\n\n".join(thoughts)


# --- from lines to blocks of code


def _blocks(lines: Sequence[str]) -> Iterator[_Block]:
    """All code of a reply, in order: the contents of fences, and outside them whatever is no prose."""
    for fenced, part in _parts(lines):
        whole = _block(part, fenced=fenced)
        found = [whole] if whole.tree else [_block(run, fenced=fenced) for run in _runs(part)]
        yield from (_without_next_example(block) for block in found if _code_of(block.lines))


def _block(lines: Sequence[str], *, fenced: bool) -> _Block:
    headless = _headless(lines)
    lines = headless or _dedented(lines)
    return _Block(lines, _tree(lines), fenced, headless is not None)


def _parts(lines: Sequence[str]) -> Iterator[tuple[bool, list[str]]]:
    """The reply cut at its fences, and whether each part is fenced; the last fence may lack its end."""
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


def _runs(lines: Sequence[str]) -> Iterator[list[str]]:
    """The stretches of lines between paragraphs of prose."""
    run: list[str] = []
    in_prose = False
    for line in lines:
        in_prose = _goes_on(line) if in_prose else _is_prose(line)
        if not in_prose:
            run.append(line)
        elif run:
            yield run
            run = []
    yield run


def _is_prose(line: str) -> bool:
    """Whether a line can only be prose; in doubt it is code, so that no code is ever lost."""
    if _INTERJECTION.match(line):
        return True
    return bool(_PROSE.match(line)) and not _CODE.match(line) and _tree([line.strip()]) is None


def _goes_on(line: str) -> bool:
    """Whether a paragraph of prose goes on with a line, which may look like anything."""
    return bool(line.strip()) and not _CODE.match(line)


def _headless(lines: Sequence[str]) -> list[str] | None:
    """The lines as the body of `task_program`; None if they are none.

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
    if not inner or start in (code[0], *inner) or _tree(lines) is not None:
        return None
    margin = min((_indent(lines[i]) for i in inner), key=len)
    if head.rstrip()[-1] in ":([{,\\" and _indent(lines[inner[0]]) == margin:
        return None  # the indentation belongs to the first line's own block or bracket
    return [f"def {TASK}():", *lines[: code[0]], margin + head, *lines[code[0] + 1 :]]


def _without_next_example(block: _Block) -> _Block:
    """The block up to a second `def task_program` and the comment that introduces it."""
    lines = block.lines
    starts = [i for i, line in enumerate(lines) if _ENTRY.match(line) and "=" not in line.split("(", 1)[0]]
    if len(starts) <= 1 or (block.tree and len(entries(block.tree)) <= 1):
        return block
    end = starts[1]
    while not lines[end - 1].strip() or lines[end - 1].startswith(("#", "@")):
        end -= 1
    return _Block(lines[:end], _tree(lines[:end]), block.fenced, block.headless)


# --- from blocks to the program


def _chosen(blocks: Sequence[_Block]) -> _Block | None:
    """The block that is the program: one that defines it, or else one that could be meant as it.

    An unfenced one at the start goes on from the prompt; otherwise the last complete one counts that is
    more than an outline.
    """
    versions = [block for block in blocks if block.defines_task and not block.headless]
    if blocks and not blocks[0].fenced and blocks[0].defines_task:
        return blocks[0]
    if versions:
        candidates = [versions[0], *(block for block in versions[1:] if block.fenced and block.tree)]
        return ([block for block in candidates if not block.is_outline] or candidates)[-1]
    for block in blocks:
        if block.headless and any(_CODE.match(line) for line in block.lines[1:]):
            return block
    return next((block for block in blocks if block.fenced), None)


def _is_idle(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Pass) or (
        isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
    )


def _with_helpers(chosen: _Block, blocks: Sequence[_Block]) -> str:
    """The chosen block with the other blocks that define, at top level, what it lacks."""
    kept = {blocks.index(chosen)}
    tree = chosen.tree
    defined: dict[int, set[str]] = {}
    for _ in range(HELPER_ROUNDS):
        missing = _undefined(tree)
        if missing and not defined:
            defined = {i: bound_names("\n".join(b.lines)) for i, b in enumerate(blocks) if not b.defines_task}
        found = set()
        for i, names in defined.items():
            if i not in kept and names & missing:
                found.add(i)
                missing -= names
        if not found:
            break
        kept |= found
        tree = _tree([_joined(blocks[i].lines for i in sorted(kept))])
    return _joined(blocks[i].lines for i in sorted(kept))


def _undefined(tree: ast.Module | None) -> set[str]:
    try:
        return set() if tree is None else {name for _, name, _ in undefined_names(tree, SKILLS)}
    except (RecursionError, MemoryError):
        return set()


# --- lines


def _tree(lines: Sequence[str]) -> ast.Module | None:
    return _tree_of("\n".join(lines))


@lru_cache(maxsize=64)  # more than the texts of a reply that are tried, so that each is parsed once
def _tree_of(text: str) -> ast.Module | None:
    tree = parsed(text)
    return None if isinstance(tree, Flaw) else tree


def _code_of(lines: Sequence[str]) -> list[int]:
    """The indices of the lines that are not blank."""
    return [i for i, line in enumerate(lines) if line.strip()]


def _indent(line: str) -> str:
    return line[: len(line) - len(line.lstrip())]


def _dedented(lines: Sequence[str]) -> list[str]:
    """The lines without the indentation of the first one; a line that lacks it stays as it is."""
    margin = next((_indent(line) for line in lines if line.strip()), "")
    return [line.removeprefix(margin) for line in lines]


def _joined(parts: Iterable[Sequence[str]]) -> str:
    """The parts as one text, each without the blank lines at its ends."""
    texts = []
    for lines in parts:
        code = _code_of(lines)
        texts.append("\n".join(lines[code[0] : code[-1] + 1]))
    return "\n\n\n".join(texts) + "\n"
