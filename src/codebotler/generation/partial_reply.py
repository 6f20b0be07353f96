"""Split a reply that is still arriving into its text and its code."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

TAG_NAME = r"(?:think(?:ing)?|thought|reason(?:ing)?)"
REASONING_START = re.compile(rf"\s*[<\[]{TAG_NAME}[>\]]", re.IGNORECASE)
REASONING_END = re.compile(rf"[<\[]/{TAG_NAME}[>\]]\n?", re.IGNORECASE)
FENCE = re.compile(r"^[ \t]*(?:`{3,}|~{3,}).*\n?", re.MULTILINE)
CODE_START = re.compile(
    r"\A(?: {2,}\S|\t)"  # the body of a function whose start is in the prompt
    r"|^(?:(?:async\s+)?def\s|class\s|import\s|from\s+[\w.]+\s+import\b|@\w)",
    re.MULTILINE,
)


@dataclass(frozen=True)
class PartialReply:
    """The part of a reply that has arrived so far, split into text and code."""

    text: str = field(repr=False)  # such as an explanation or reasoning
    code: str = field(repr=False)  # the last block of code so far; empty until code begins


def split_partial(reply: str) -> PartialReply:
    """Split a reply that is still arriving into text and code. Reasoning between tags counts as text."""
    thought = max((tag.end() for tag in REASONING_END.finditer(reply)), default=0)
    reasoning, answer = reply[:thought], reply[thought:]
    if REASONING_START.match(answer):
        return PartialReply(reply, "")
    parts = FENCE.split(answer)  # text and code take turns
    if len(parts) > 1:
        return PartialReply(reasoning + "".join(parts[::2]), parts[1::2][-1])
    code = CODE_START.search(answer)
    start = len(answer) if code is None else code.start()
    return PartialReply(reasoning + answer[:start], answer[start:])
