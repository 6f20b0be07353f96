"""Split a reply that is still arriving into its text and its code."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

REPLY_FENCE = re.compile(r"[ \t]*(`{3,}|~{3,})")
CODE_START = re.compile(r"(?:async\s+)?def\s|class\s|import\s|from\s+[\w.]+\s+import\b|@\w")
CONTINUATION = re.compile(r" {2,}\S|\t")  # the body of a function whose start is in the prompt
REASONING_END = re.compile(r"[<\[]/(?:think(?:ing)?|thought|reason(?:ing)?)[>\]]", re.IGNORECASE)
REASONING_TAG = re.compile(r"\s*[<\[](?P<end>/?)(?:think(?:ing)?|thought|reason(?:ing)?)[>\]]", re.IGNORECASE)


@dataclass(frozen=True)
class PartialReply:
    """The part of a reply that has arrived so far."""

    text: str = field(repr=False)  # such as an explanation or reasoning
    code: str = field(repr=False)  # the last block of code so far; empty until code begins


def split_partial(reply: str) -> PartialReply:
    """Split the start of a reply into text and code, where reasoning between tags counts as text."""
    if CONTINUATION.match(reply) and not REASONING_TAG.match(reply):
        return PartialReply("", reply)
    text: list[str] = []
    code: list[str] = []
    fence, is_bare, is_reasoning = "", False, False
    for line in reply.splitlines(keepends=True):
        marks = REPLY_FENCE.match(line)
        tag = REASONING_TAG.match(line)
        if tag and tag["end"]:  # reasoning that began in the prompt may contain drafts of code
            text, code, is_bare = [*text, *code, line], [], False
            is_reasoning = False
        elif is_reasoning or tag:
            text.append(line)
            is_reasoning = not REASONING_END.search(line)
        elif fence:
            is_end = marks is not None and marks[1].startswith(fence) and not line.strip().strip(fence[0])
            fence = "" if is_end else fence
            code += [] if is_end else [line]
        elif marks is not None:
            fence, code, is_bare = marks[1], [], False
        elif is_bare or (not code and CODE_START.match(line)):
            is_bare = True
            code.append(line)
        else:
            text.append(line)
    return PartialReply("".join(text), "".join(code))
