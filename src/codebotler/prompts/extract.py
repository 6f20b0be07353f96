"""From a model's whole reply to the program it means; nothing is ever completed or mended."""

from __future__ import annotations

import ast
import keyword
import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from codebotler.core.program import TASK, Flaw, Program, bound_names, entries, parsed, undefined_names
from codebotler.core.skills import SKILLS


def program_of(reply: str) -> Program:
    """The program that a model means by a whole reply.

    Of several versions between fences, the last one that is complete is meant; what a model thinks aloud,
    between `<think>` and `</think>`, is left out.

    Whole lines are kept or dropped, and a reply that was cut off stays cut off: only what is plainly no
    code, and a next example that a base model ran on into, is left out.

    Args:
        reply: code with or without fences and prose, or the indented body of `task_program` alone.
    """
    lines = re.split(r"\r\n|\r|\n", reply)
    if _is_plain(lines):
        return Program(_text(lines))
    reply = _aloud("\n".join(lines))
    lines = reply.split("\n")
    blocks = tuple(_blocks(lines))
    chosen = _choose(blocks)
    if chosen is None:
        return Program(reply)
    return Program(_with_definitions(chosen, blocks))


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


def _aloud(reply: str) -> str:
    """A reply without thoughts; tags in a fence are code, unless the fence stands in a thought itself."""
    kept = ""
    start = 0
    for found in _ASIDE.finditer(reply):
        if found["thought"]:
            kept += reply[start : found.start()]
        elif not found["end"] or start:
            continue
        start = found.end()
    return kept + reply[start:]


def _is_plain(lines: Sequence[str]) -> bool:
    """Whether a reply is a program as it stands."""
    source = "\n".join(lines)
    tree = parsed(source)
    return not isinstance(tree, Flaw) and TASK in bound_names(source) and len(entries(tree)) <= 1


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
    if not isinstance(parsed("\n".join(_headless(lines) or _dedented(lines))), Flaw):
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
    return bool(_PROSE.match(line)) and not _CODE.match(line) and isinstance(parsed(line.strip()), Flaw)


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
    return not isinstance(parsed("\n".join(lines)), Flaw)


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
    tree = parsed("\n".join(lines))
    starts = [i for i, line in enumerate(lines) if _ENTRY.match(line) and "=" not in line.split("(", 1)[0]]
    if len(starts) <= 1 or (not isinstance(tree, Flaw) and len(entries(tree)) <= 1):
        return lines
    end = starts[1]
    while not lines[end - 1].strip() or lines[end - 1].startswith(("#", "@")):
        end -= 1
    return lines[:end]


def _choose(blocks: Sequence[_Block]) -> _Block | None:
    """The block that is the program: one that defines it, or else one that could be meant as it.

    Of several, an unfenced one at the start goes on from the prompt; else the last complete one is meant
    that is more than an outline.
    """
    versions = [block for block in blocks if block.defines_task and not block.headless]
    if blocks and not blocks[0].fenced and blocks[0].defines_task:
        return blocks[0]
    if versions:
        whole = [block for block in versions[1:] if block.fenced and _tree_is_fine(block.lines)]
        candidates = [versions[0], *whole]
        return ([block for block in candidates if not _is_outline(block)] or candidates)[-1]
    for block in blocks:
        if block.headless and any(_CODE.match(line) for line in block.lines[1:]):
            return block
    return next((block for block in blocks if block.fenced), None)


def _is_outline(block: _Block) -> bool:
    """Whether nothing is done in it: its program is a docstring, `...` or `pass`."""
    tree = parsed("\n".join(block.lines))
    return not isinstance(tree, Flaw) and any(all(map(_is_idle, e.body)) for e in entries(tree))


def _is_idle(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Pass) or (
        isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
    )


def _with_definitions(chosen: _Block, blocks: Sequence[_Block]) -> str:
    """The chosen block with the other blocks that define, at top level, what it lacks."""
    bound = [set() if block.defines_task else bound_names("\n".join(block.lines)) for block in blocks]
    definers: defaultdict[str, list[int]] = defaultdict(list)
    for i, names in enumerate(bound):
        for name in names:
            definers[name].append(i)
    kept: dict[int, str] = {}
    uses = _Uses()
    new = [next(i for i, block in enumerate(blocks) if block is chosen)]
    while new:
        for i in new:
            kept[i] = _text(blocks[i].lines).strip("\n")
            uses.add(i, kept[i], bound[i] or {*definers})
        missing = uses.missing()
        new = []
        for i in sorted({i for name in missing for i in definers[name]}.difference(kept)):
            if bound[i] & missing:
                new.append(i)
                missing -= bound[i]
    return "\n\n\n".join(kept[i] for i in sorted(kept)) + "\n"


class _Uses:
    """Which names the blocks of a program lack from each other; each block is read only when it is added."""

    def __init__(self) -> None:
        self.given: dict[str, int] = {}
        """The first block that defines a name, or all names where it is `*`."""
        self.lacking: defaultdict[str, list[tuple[int, bool, bool]]] = defaultdict(list)
        """The blocks that lack a name, and whether even a definition in front or behind is no help."""
        self.changed: set[str] = set()

    def add(self, at: int, source: str, names: set[str]) -> None:
        """Read one more block.

        Args:
            at: its place among all blocks.
            source: its text.
            names: what it may define.
        """
        everywhere = _declared_global(source)
        asked = sorted(names | everywhere)
        end = source.count("\n") + 1
        found = _undefined("\n".join([source, *asked]))
        alone = {name for line, name in found if line <= end}
        for name in {*asked, *_starred(source)}.difference(name for line, name in found if line > end):
            place = -1 if name in everywhere else at
            self.given[name] = min(place, self.given.get(name, place))
        if alone:
            definitions = "".join(f"{name} = 0\n" for name in sorted(alone))
            in_front = {name for _, name in _undefined(definitions + source)}
            behind = {name for _, name in _undefined(f"{source}\n{definitions}")}
            for name in alone:
                self.lacking[name].append((at, name in in_front, name in behind))
        self.changed |= names | alone

    def missing(self) -> set[str]:
        """What is lacking of the names that blocks added since the last time lack or define."""
        changed, self.changed = self.changed, set()
        return {name for name in changed if any(self.lacks(name, *one) for one in self.lacking[name])}

    def lacks(self, name: str, at: int, in_front: bool, behind: bool) -> bool:  # noqa: FBT001 - a record
        """Whether a block lacks a name among all blocks added so far."""
        given = [self.given[one] for one in (name, "*") if one in self.given]
        if not given:
            return True
        return in_front if min(given) < at else behind


def _declared_global(source: str) -> set[str]:
    """The names that functions share with the module, which are then taken to be defined everywhere."""
    return {name for node in _nodes(source) if isinstance(node, ast.Global) for name in node.names}


def _starred(source: str) -> set[str]:
    """`*` for a source that imports all names of a module, whichever they are."""
    return {"*" for node in _nodes(source) if isinstance(node, ast.ImportFrom) and node.names[0].name == "*"}


def _nodes(source: str) -> Iterator[ast.AST]:
    tree = parsed(source)
    return iter(()) if isinstance(tree, Flaw) else ast.walk(tree)


def _undefined(source: str) -> list[tuple[int, str]]:
    """Where a program uses names that nothing defines; none can be told of one that does not parse."""
    tree = parsed(source)
    if isinstance(tree, Flaw):
        return []
    try:
        return [(line, name) for line, name, _ in undefined_names(tree, SKILLS)]
    except (RecursionError, MemoryError):
        return []


def _text(lines: Sequence[str]) -> str:
    """The lines as a text, without the blank ones at its ends."""
    code = _code_of(lines)
    return "\n".join(lines[code[0] : code[-1] + 1]) + "\n" if code else ""
