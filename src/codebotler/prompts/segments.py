"""Split a model's reply into reasoning and answer, and the answer into fenced code and text."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from typing import Literal, TypeAlias

from codebotler.core.program import TASK_FUNCTION
from codebotler.prompts.lines import is_code, is_residue

FENCE_MARGIN = 3  # maximum columns of indentation of a closing fence
MAX_ENDS = 5  # possible ends of a fence to try until its code parses
MAX_MARKERS = 9  # markers to try at the start of a line
MARKER = re.compile(
    r"""(?ix) <\|channel\|?> \s* (?P<channel>[a-z]+) (?:<\|message\|>)?
    | [<\[\u25c1] (?P<left>[|\uff5c])? (?P<slash>/)?
      (?P<name>[a-z][\w:.\u2581-]*) (?P<right>[|\uff5c])? [>\]\u25b7]"""
)
THOUGHT_TAG = re.compile(
    r"think|thought|reason|reflect|analy|scratch|monolog|deliberat|brainstorm|ponder|^cot$"
)
START_WORDS, END_WORDS = {"start", "begin", "prefix"}, {"end", "suffix"}
WHOLE_LINE = re.compile(r"[^\n]*\n|[^\n]+")
FENCE_LINE = re.compile(
    r"(?P<indent>[ \t]*(?:(?:[-*+]|\d+[.)])[ \t]+)?)(?P<marks>`{3,}|~{3,})(?P<info>[^`\n]*)\n?$"
)
DEFINITION = re.compile(rf"^\s*(?:async\s+)?def\s+{TASK_FUNCTION}\b", re.MULTILINE)
NEXT_TURN = re.compile(
    r"(?im)<(?:\|(?:im_)?start|\|start_header_id|start_of_turn)\|?>user\b|<[|\uff5c]user[|\uff5c]>|\[INST\]"
    r"|^(?:user|human):"
)

ParseTest: TypeAlias = Callable[[Sequence[str]], bool]
"""Returns whether lines are a program or the body of a program."""


@dataclass(frozen=True)
class Segment:
    """A part of a model's reply.

    Args:
        kind: `fence`, `thought` for text between markers, `end` for an unmatched closing marker, or `text`.
        text: its text, without the markers of a thought.
        code: its lines that may be code.
    """

    kind: Literal["text", "fence", "thought", "end"]
    text: str
    code: Sequence[str] = ()


def answer_of(reply: str, parses: ParseTest) -> tuple[list[Segment], str]:
    """Split a reply into its answer, as segments of fenced code and text, and its reasoning, as text.

    Everything before an unmatched closing marker is reasoning, since the opening marker may be in the prompt.
    A closing marker at the very end, after other reasoning, is ignored. `parses` tests if lines are valid
    Python, which shows where a code block ends.
    """
    segments = [*_segments(_first_turn(reply), parses)]
    answer: list[Segment] = []
    thoughts: list[str] = []
    for number, segment in enumerate(segments, 1):
        if segment.kind == "thought":
            thoughts.append(segment.text)
        elif segment.kind != "end":
            answer.append(segment)
        elif not thoughts or any(later.code and later.text.strip() for later in segments[number:]):
            thoughts.append("".join(one.text for one in answer))
            answer = []
    return answer, "\n\n".join(filter(None, map(str.strip, thoughts)))


def _first_turn(reply: str) -> str:
    """Cut off a reply where a model that did not stop starts to write the user's next turn."""
    for turn in NEXT_TURN.finditer(reply):
        if DEFINITION.search(reply[: turn.start()]):
            return reply[: turn.start()]
    return reply


def _segments(reply: str, parses: ParseTest) -> Iterator[Segment]:
    while reply:
        start, segment, end = next(_find_marked(reply, parses), (len(reply), None, len(reply)))
        if text := reply[:start]:
            yield Segment("text", text, text.split("\n"))
        if segment:
            yield segment
        reply = reply[end:]


def _find_marked(reply: str, parses: ParseTest) -> Iterator[tuple[int, Segment, int]]:
    """Yield the start, segment and end of possible fences and thoughts. Only the first is reliable."""
    for line in WHOLE_LINE.finditer(reply):
        start, end, text = line.start(), line.end(), line[0]
        if (fence := FENCE_LINE.match(text)) and not _is_in_code(fence, reply[:start]):
            code, length = _read_fence(fence, reply[end:], parses)
            yield start, Segment("fence", reply[start : end + length], code), end + length
        for marker in islice(_markers(text), MAX_MARKERS):
            if found := _read_thought(marker, reply[start:]):
                segment, length = found
                yield start + marker.start, segment, start + length


# --- fences


def _is_in_code(fence: re.Match[str], before: str) -> bool:
    """Whether an indented fence is inside code, such as a docstring, and not inside a list."""
    lines = reversed(before.split("\n"))
    head = next((line for line in lines if line and not line[0].isspace()), "")
    return not fence["indent"].strip() and len(fence["indent"]) > FENCE_MARGIN and is_code(head)


def _read_fence(fence: re.Match[str], rest: str, parses: ParseTest) -> tuple[Sequence[str], int]:
    """Return the code after an opening fence, and the length of the code and the closing fence.

    A string may contain a fence, and a closing fence may be on a line of code. Therefore the code ends at the
    first fence up to which it parses, or else at the next fence.
    """
    lines = rest.split("\n")
    indent = re.sub(r"\S", " ", fence["indent"])
    code = [line.removeprefix(indent) for line in lines]
    closing = re.compile(
        rf"[ ]{{0,{max(FENCE_MARGIN, len(indent))}}}{fence['marks']}{fence['marks'][0]}*\s*$"
    )
    ends = (i for i, line in enumerate(lines) if line.rstrip().endswith(fence["marks"]))
    for end in chain(islice(ends, MAX_ENDS), [len(lines)]):
        last = [line.rstrip().rstrip(fence["marks"][0]) for line in code[end : end + 1]]
        is_end = end == len(lines) or closing.match(lines[end]) or last[0].strip()
        if is_end and parses([*code[:end], *last]):
            return [*code[:end], *last], _length(lines[: end + 1])
    end = next((i for i, line in enumerate(lines) if closing.match(line) or _interrupts(line)), len(lines))
    is_closed = end < len(lines) and closing.match(lines[end])
    return code[:end], _length(lines[: end + 1 if is_closed else end])


def _interrupts(line: str) -> bool:
    """Whether a line shows that a fence was not closed, since it opens another fence or ends a thought."""
    fence = FENCE_LINE.match(line)
    is_end = any(
        marker.is_last and marker.is_thought and marker.is_at_edge(line) for marker in _markers(line)
    )
    return bool(fence and fence["info"].strip()) or is_end


def _length(lines: Sequence[str]) -> int:
    return sum(len(line) + 1 for line in lines)


# --- thoughts


@dataclass(frozen=True)
class _Marker:
    """A marker at the start or end of a thought, such as `<think>`, `[/THINK]` or `<|END_THINKING|>`."""

    name: str  # without words such as `begin` and `end`
    is_last: bool  # whether it closes the pair
    is_token: bool  # whether it is a chat template token, as its bars show
    start: int
    end: int

    @property
    def is_thought(self) -> bool:
        return bool(THOUGHT_TAG.search(self.name))

    def ends_with(self, other: _Marker) -> bool:
        """Whether another marker closes this one."""
        names = {self.name, "", "channel"} if self.is_token else {self.name}
        return other.is_last and (other.name in names or (self.is_thought and other.is_thought))

    def is_at_edge(self, text: str) -> bool:
        """Whether the marker is at the start or the end of a line in the text."""
        before = text[text.rfind("\n", 0, self.start) + 1 : self.start]
        return not before.strip() or not text[self.end :].partition("\n")[0].strip()


def _markers(text: str, start: int = 0) -> Iterator[_Marker]:
    for found in MARKER.finditer(text, start):
        words = re.split(r"[_\u2581]", (found["channel"] or found["name"]).lower())
        is_last = bool(found["slash"] or (found["right"] and not found["left"]) or END_WORDS & {*words})
        name = "_".join(word for word in words if word not in {*START_WORDS, *END_WORDS, "of"})
        yield _Marker(name, is_last, bool(found["channel"] or found["left"]), *found.span())


def _read_thought(marker: _Marker, rest: str) -> tuple[Segment, int] | None:
    """Return the thought that a marker in the first line opens or closes, and its end, or else None.

    A thought without an end was cut off. Other pairs of markers enclose a thought only if a program follows.
    """
    if marker.is_last:
        is_end = marker.is_thought and marker.is_at_edge(rest)
        return (Segment("end", rest[marker.start : marker.end]), marker.end) if is_end else None
    if not is_residue(rest[: marker.start]):
        return None
    ends = [other for other in _markers(rest, marker.end) if marker.ends_with(other)]
    last = next((end for end in ends if end.is_at_edge(rest)), ends[0] if ends else None)
    if last is None:
        return (Segment("thought", rest[marker.end :]), len(rest)) if marker.is_thought else None
    if marker.is_thought or (not marker.is_token and DEFINITION.search(rest[last.end :])):
        return Segment("thought", rest[marker.end : last.start]), last.end
    return None
