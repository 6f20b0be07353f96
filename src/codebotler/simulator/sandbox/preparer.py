"""Parses and compiles programs in an isolated process, and decides which are tame, but never executes them.

A program that runs in several worlds is compiled only once. The engine passes the code on to the child that
runs it, without unmarshalling it.
"""

from __future__ import annotations

import os
import unicodedata as _  # noqa: F401 - needed to parse "\N{...}", and cannot be imported later
from _json import encode_basestring_ascii as quoted
from marshal import dumps

from codebotler.simulator.sandbox import (
    CHANNEL,
    CPU_SECONDS,
    MAX_CODE,
    PLAIN,
    REFUSED,
    TAME,
    WITHOUT_REFERENCES,
)
from codebotler.simulator.sandbox.channel import receive_at_once, send_frames
from codebotler.simulator.sandbox.fuel import PROGRAM_TOO_LARGE, prepared
from codebotler.simulator.sandbox.isolation import enclose, give_up_rights, usable_filter

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import NoReturn

PREPARER_DOOR = 5
REHEARSAL = "def task_program():\n    for room in get_all_rooms():\n        say(f'in {room}')\n"


def get_ready(_role: str) -> tuple[()]:
    """Prepare and isolate this process."""
    give_up_rights()
    seccomp = usable_filter()
    answer(REHEARSAL, lowercase=True, skills=("get_all_rooms", "say"))
    os.dup2(PREPARER_DOOR, CHANNEL)
    os.closerange(CHANNEL + 1, 256)
    enclose(seccomp, CPU_SECONDS)
    return ()


def serve() -> NoReturn:
    """Compile the programs that the engine sends until it hangs up."""
    while True:
        sources, lowercase, skills = receive_at_once()
        send_frames([answer(source, lowercase=lowercase, skills=skills) for source in sources])


def answer(source: str, *, lowercase: bool, skills: tuple[str, ...] | None = None) -> bytes:
    """Return PLAIN or TAME followed by the compiled program, or REFUSED followed by the reason as JSON."""
    try:
        names = None if skills is None else frozenset(skills)
        code, tame = prepared(source, lowercase=lowercase, skills=names)
        data = dumps(code, WITHOUT_REFERENCES)
        if len(data) > MAX_CODE:
            raise MemoryError(PROGRAM_TOO_LARGE)  # noqa: TRY301 - the error that the compiler would raise
    except Exception as error:  # noqa: BLE001 - the compiler may raise many errors
        line = error.lineno if isinstance(error, SyntaxError) else None
        message = error.msg if isinstance(error, SyntaxError) else str(error)
        kind = quoted(type(error).__name__)
        return REFUSED + f"[{kind},{quoted(message[:1000])},{'null' if line is None else line}]".encode()
    return (TAME if tame else PLAIN) + data
