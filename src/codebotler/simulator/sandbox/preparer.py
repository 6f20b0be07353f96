"""Parses and compiles programs in an isolated process, decides which are tame, and never executes them.

A program runs in several worlds; it is compiled once, in a process that is warm. The engine passes the code
on, unopened, to the child that runs it.
"""

from __future__ import annotations

import os
import unicodedata as _  # noqa: F401 - for "\N{...}" in a program: an isolated process can import nothing
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
    """Isolate this process."""
    give_up_rights()
    seccomp = usable_filter()
    answer(REHEARSAL, lowercase=True, skills=("get_all_rooms", "say"))
    os.dup2(PREPARER_DOOR, CHANNEL)
    os.closerange(CHANNEL + 1, 256)
    enclose(seccomp, CPU_SECONDS)
    return ()


def serve() -> NoReturn:
    """Prepare the programs that the engine sends until it closes its end."""
    while True:
        sources, lowercase, skills = receive_at_once()
        send_frames([answer(source, lowercase=lowercase, skills=skills) for source in sources])


def answer(source: str, *, lowercase: bool, skills: tuple[str, ...] | None = None) -> bytes:
    """PLAIN or TAME and a program's code, or REFUSED and the reason as JSON."""
    try:
        names = None if skills is None else frozenset(skills)
        code, tame = prepared(source, lowercase=lowercase, skills=names)
        data = dumps(code, WITHOUT_REFERENCES)
        if len(data) > MAX_CODE:
            raise MemoryError(PROGRAM_TOO_LARGE)  # noqa: TRY301 - as by the compiler
    except Exception as error:  # noqa: BLE001 - the compiler raises many errors
        line = error.lineno if isinstance(error, SyntaxError) else None
        message = error.msg if isinstance(error, SyntaxError) else str(error)
        kind = quoted(type(error).__name__)
        return REFUSED + f"[{kind},{quoted(message[:1000])},{'null' if line is None else line}]".encode()
    return (TAME if tame else PLAIN) + data
