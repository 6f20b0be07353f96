"""Extract the program from a model's reply, without fixing or completing it.

The reply is split into thoughts, fenced code and text. Fences and text are then split into blocks of code,
without prose and chat template tokens, and one block is chosen as the program.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from codebotler.core.program import (
    TASK_FUNCTION,
    Program,
    module_bound_names,
    task_definitions,
    undefined_names,
)
from codebotler.core.skills.paper import SKILLS
from codebotler.core.text.unicode import compose
from codebotler.prompts.lines import continues_prose, is_code, is_prose, parse_lines, trim, without_residue
from codebotler.prompts.segments import Segment, answer_of
from codebotler.simulator.process.isolated_call import IsolatedCallError, isolated

MAX_HELPER_DEPTH = 20  # levels of helpers that call helpers; replies have two or three


@dataclass(frozen=True)
class ReplyContent:
    """The parts of a model's reply.

    Args:
        program: the text of the program, or the reply without reasoning if no program is found.
        reasoning: the model's reasoning between markers; may be empty.
        has_code: False if the reply certainly has no code outside its reasoning.
    """

    program: str
    reasoning: str
    has_code: bool


def read_reply(reply: str, *, continues: bool = False) -> ReplyContent:
    """Split a model's complete reply into a program and reasoning, as `program_of` describes.

    Raises:
        EngineError: no isolated process can be started.
    """
    reply = compose(reply)
    try:
        return ReplyContent(*extract(reply, continues=continues))
    except IsolatedCallError:
        return ReplyContent(reply, "", has_code=True)


def program_of(reply: str, *, continues: bool = False) -> Program:
    """Return the program in a model's complete reply.

    If `task_program` is defined several times, the last complete definition counts. Reasoning between markers
    such as `<think>` and `</think>` is dropped, as is text between other markers if a program follows. Apart
    from this, only chat template tokens, fences and lines that are certainly not code are dropped. A program
    that was cut off is not completed.

    Args:
        reply: code with or without fences and prose, or only the indented body of `task_program`. A reply
            that takes seconds to parse is returned unchanged.
        continues: whether a base model continued the prompt; if so, the first definition counts, and any
            further examples are dropped.

    Raises:
        EngineError: no isolated process can be started.
    """
    return Program(read_reply(reply, continues=continues).program)


def program_in(text: str) -> str:
    """Return a text unchanged if it defines `task_program`, else the program that `program_of` finds."""
    try:
        return text if defines_task(text) else program_of(text).source
    except IsolatedCallError:
        return text


@isolated("def task_program():\n    say('hello')\n")
def defines_task(text: str) -> bool:
    """Whether a text is valid Python that defines or assigns `task_program` at module level."""
    return TASK_FUNCTION in module_bound_names(text)


@isolated(
    "Here it is:\n```python\ndef task_program():\n    greet()\n```\n```\ndef greet():\n    say('hello')\n```"
)
def extract(reply: str, *, continues: bool = False) -> tuple[str, str, bool]:
    """Return the program and the reasoning in a reply, and whether it has any code; see `program_of`."""
    lines = re.split(r"\r\n|\r|\n", reply.removeprefix("\ufeff"))
    if _is_program(lines, continues=continues):
        return _join([lines]), "", True
    answer, reasoning = answer_of("\n".join(lines), lambda code: _block(code, fenced=True).tree is not None)
    blocks = [block for segment in answer for block in _blocks(segment, continues=continues)]
    chosen = _choose(blocks, continues=continues)
    program = "".join(s.text for s in answer) if chosen is None else _with_helpers(chosen, blocks)
    return program, reasoning, bool(blocks)


def _is_program(lines: Sequence[str], *, continues: bool) -> bool:
    """Whether the complete reply is a program, even if its strings look like fences or prose."""
    tree = parse_lines(lines)
    is_one = tree is not None and not (continues and len(task_definitions(tree)) > 1)
    return (
        is_one
        and len(trim(lines)) == len(_strip_blank_lines(lines))
        and TASK_FUNCTION in module_bound_names("\n".join(lines))
    )


# --- from segments to blocks of code


@dataclass(frozen=True, eq=False)
class _Block:
    """A group of lines in a reply that belong together as code."""

    lines: Sequence[str]  # without common indentation
    tree: ast.Module | None  # None if they do not parse
    fenced: bool
    headless: bool  # whether it is a body to which `def task_program():` was added

    @property
    def defines_task(self) -> bool:
        return any(_ENTRY.match(line) for line in self.lines)

    @property
    def is_outline(self) -> bool:
        """Whether `task_program` in this block contains nothing but a docstring, `...` or `pass`."""
        definitions = [] if self.tree is None else task_definitions(self.tree)
        return any(all(map(_is_idle, last.body)) for last in definitions[-1:])


def _is_idle(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Pass) or (
        isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
    )


_ENTRY = re.compile(rf"(?:async\s+)?def\s+{TASK_FUNCTION}\b|{TASK_FUNCTION}\s*=(?!=)")


def _blocks(segment: Segment, *, continues: bool) -> Iterator[_Block]:
    """Yield the blocks of a segment: the whole segment if it parses, else the parts that are not prose."""
    fenced = segment.kind == "fence"
    whole = _block(segment.code, fenced=fenced)
    found = [whole] if whole.tree else [_block(run, fenced=fenced) for run in _code_runs(segment.code)]
    for block in found:
        if _code_of(block.lines):
            yield from _split_versions(block, continues=continues)


def _block(lines: Sequence[str], *, fenced: bool) -> _Block:
    """Make a block of lines, without chat template tokens if the lines parse only without them."""
    block = _block_as_written(trim(lines), fenced=fenced)
    if block.tree:
        return block
    without = _block_as_written(trim([without_residue(line) for line in lines]), fenced=fenced)
    return without if without.tree else block


def _block_as_written(lines: Sequence[str], *, fenced: bool) -> _Block:
    headless = _as_body(lines)
    lines = headless or _dedent(lines)
    return _Block(lines, parse_lines(lines), fenced, headless is not None)


def _code_runs(lines: Sequence[str]) -> Iterator[list[str]]:
    run: list[str] = []
    in_prose = False
    for line in lines:
        in_prose = continues_prose(line) if in_prose else is_prose(line)
        if not in_prose:
            run.append(line)
        elif run:
            yield run
            run = []
    yield run


def _as_body(lines: Sequence[str]) -> list[str] | None:
    """Add a header to the lines if they are the body of `task_program`, or return None otherwise.

    The first line may have no indentation, since the prompt may end with it.
    """
    code = _code_of(lines)
    if not code or is_prose(lines[code[0]].strip()):
        return None
    head = lines[code[0]]
    start = next((i for i in code if _ENTRY.match(lines[i].lstrip())), None)
    if _indent(head):
        if start is not None and len(_indent(lines[start])) >= len(_indent(head)):
            return None
        return [f"def {TASK_FUNCTION}():", *lines]
    inner = code[1 : next((n for n, i in enumerate(code) if n and not _indent(lines[i])), None)]
    if not inner or start in (code[0], *inner) or parse_lines(lines) is not None:
        return None
    margin = min((_indent(lines[i]) for i in inner), key=len)
    if head.rstrip()[-1] in ":([{,\\" and _indent(lines[inner[0]]) == margin:
        return None  # the indentation belongs to the first line's own block or bracket
    return [f"def {TASK_FUNCTION}():", *lines[: code[0]], margin + head, *lines[code[0] + 1 :]]


def _split_versions(block: _Block, *, continues: bool) -> list[_Block]:
    """Split a block before each further definition of `task_program` and the comments above it.

    A chat model's block that parses is not split, since its last definition counts. A base model's block may
    contain further examples.
    """
    lines = block.lines
    starts = [i for i, line in enumerate(lines) if _ENTRY.match(line) and "=" not in line.split("(", 1)[0]]
    if len(starts) <= 1 or (block.tree and (not continues or len(task_definitions(block.tree)) <= 1)):
        return [block]
    cuts = [0, *(_introduction(lines, start) for start in starts[1:]), len(lines)]
    parts = [_block(lines[start:end], fenced=block.fenced) for start, end in pairwise(cuts)]
    return [replace(part, headless=block.headless and not i) for i, part in enumerate(parts)]


def _introduction(lines: Sequence[str], start: int) -> int:
    """Return the index of the first comment or decorator above a definition."""
    while start and (not lines[start - 1].strip() or lines[start - 1].startswith(("#", "@"))):
        start -= 1
    return start


# --- from blocks to the program


def _choose(blocks: Sequence[_Block], *, continues: bool) -> _Block | None:
    """Choose the block that defines the program, or else a block that may be the program.

    The first block of a base model continues the prompt. For a chat model, the last complete block that is
    more than an outline counts.
    """
    if continues and blocks and blocks[0].defines_task:
        return blocks[0]
    versions = [block for block in blocks if block.defines_task and not block.headless]
    bodies = [b for b in blocks if b.headless and (b.tree or any(map(is_code, b.lines[1:])))]
    candidates = versions or bodies or [block for block in blocks if block.fenced]
    if continues:
        return candidates[0] if candidates else None
    complete = [block for block in candidates if block.tree]
    best = [block for block in complete if not block.is_outline] or complete or candidates
    return best[-1] if best else None


def _with_helpers(chosen: _Block, blocks: Sequence[_Block]) -> str:
    """Add the blocks, even earlier versions, that define names which the chosen block needs."""
    at = blocks.index(chosen)
    kept = {at}
    tree = chosen.tree
    defined: dict[int, set[str]] = {}
    for _ in range(MAX_HELPER_DEPTH):
        missing = _undefined(tree)
        if missing and not defined:
            others = [i for i, block in enumerate(blocks) if not block.defines_task]
            others += [i for i, block in enumerate(blocks[:at]) if block.defines_task and not block.headless]
            defined = {i: module_bound_names("\n".join(blocks[i].lines)) for i in others}
        found = set()
        for i, names in defined.items():
            if i not in kept and names & missing:
                found.add(i)
                missing -= names
        if not found:
            break
        kept |= found
        tree = parse_lines([_join(blocks[i].lines for i in sorted(kept))])
    return _join(blocks[i].lines for i in sorted(kept))


def _undefined(tree: ast.Module | None) -> set[str]:
    try:
        return set() if tree is None else {name for _, name, _ in undefined_names(tree, SKILLS)}
    except (RecursionError, MemoryError):
        return set()


# --- lines


def _code_of(lines: Sequence[str]) -> list[int]:
    return [i for i, line in enumerate(lines) if line.strip()]


def _indent(line: str) -> str:
    return line[: len(line) - len(line.lstrip())]


def _dedent(lines: Sequence[str]) -> list[str]:
    margin = next((_indent(line) for line in lines if line.strip()), "")
    return [line.removeprefix(margin) for line in lines]


def _strip_blank_lines(lines: Sequence[str]) -> Sequence[str]:
    code = _code_of(lines)
    return lines[code[0] : code[-1] + 1] if code else []


def _join(parts: Iterable[Sequence[str]]) -> str:
    return "\n\n\n".join("\n".join(_strip_blank_lines(lines)) for lines in parts) + "\n"
