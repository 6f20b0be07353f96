"""A reply that is still arriving: its text until code begins, and then the code."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

FENCE = re.compile(r"[ \t]*(`{3,}|~{3,})")
CODE = re.compile(r"(?:async\s+)?def\s|class\s|import\s|from\s+[\w.]+\s+import\b|@\w")
CONTINUED = re.compile(r" {2,}\S|\t")  # the body of a function that the prompt began
THOUGHT_END = re.compile(r"[<\[]/(?:think(?:ing)?|thought|reason(?:ing)?)[>\]]", re.IGNORECASE)
THOUGHT = re.compile(r"\s*[<\[](?P<end>/?)(?:think(?:ing)?|thought|reason(?:ing)?)[>\]]", re.IGNORECASE)


@dataclass(frozen=True)
class ArrivingReply:
    """As much of a reply as has arrived.

    Args:
        text: what is no code, such as an explanation or thoughts.
        code: the code that arrived last; empty until it begins.
    """

    text: str = field(repr=False)
    code: str = field(repr=False)


def arriving(reply: str) -> ArrivingReply:
    """Tell text from code in the beginning of a reply, for showing it.

    Code is what stands in fences, what follows a line such as a definition, and an indented beginning, with
    which base models go on. In thoughts between markers there is none.
    """
    if CONTINUED.match(reply) and not THOUGHT.match(reply):
        return ArrivingReply("", reply)
    text: list[str] = []
    code: list[str] = []
    fence, is_bare, is_thought = "", False, False
    for line in reply.splitlines(keepends=True):
        marks = FENCE.match(line)
        thought = THOUGHT.match(line)
        if thought and thought["end"]:  # the prompt began the thoughts, which may hold drafts of code
            text, code, is_bare = [*text, *code, line], [], False
            is_thought = False
        elif is_thought or thought:
            text.append(line)
            is_thought = not THOUGHT_END.search(line)
        elif fence:
            is_end = marks is not None and marks[1].startswith(fence) and not line.strip().strip(fence[0])
            fence = "" if is_end else fence
            code += [] if is_end else [line]
        elif marks is not None:
            fence, code, is_bare = marks[1], [], False
        elif is_bare or (not code and CODE.match(line)):
            is_bare = True
            code.append(line)
        else:
            text.append(line)
    return ArrivingReply("".join(text), "".join(code))
