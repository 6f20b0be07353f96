"""Compiles programs in closed processes, once for all their runs, and decides which are tame."""

from __future__ import annotations

from base64 import b64decode, b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from marshal import dumps
from typing import Any

from codebotler.core.trace import Outcome, RunError, Status
from codebotler.simulator.process.isolated_call import IsolatedCallError, isolated
from codebotler.simulator.sandbox import MAX_CODE, WITHOUT_REFERENCES
from codebotler.simulator.sandbox.fuel import PROGRAM_TOO_LARGE, prepared

MAX_SOURCE = 5_000_000
LONG_SOURCE = 100_000  # characters; longer lists of programs are compiled one by one
REHEARSAL = "def task_program():\n    for room in get_all_rooms():\n        say(f'in {room}')\n"
CODE = "code"  # marks a result that is no error
STATUSES = {"TimeoutError": Status.TIMEOUT, "MemoryError": Status.PYTHON_ERROR}  # others are killed


@dataclass(frozen=True)
class CompiledProgram:
    """A program's compiled code, and whether it may run in a process that it shares with other programs."""

    code: bytes  # marshalled; only a child may unmarshal it
    is_tame: bool  # whether it leaves nothing behind for later runs in its process


@lru_cache(maxsize=16)  # a program runs in several worlds
def compile_program(source: str, literals: str, skills: tuple[str, ...]) -> CompiledProgram | Outcome:
    """Compile a program in an isolated process, or return the outcome of all its runs if that fails.

    `literals` is the suite's setting, `lowercase` or `as-written`. `skills` are the names of the skills that
    the program may call. Raise EngineError if no isolated process can be started.
    """
    if len(source) > MAX_SOURCE:
        message = f"the program is longer than {MAX_SOURCE:,} characters"
        return Outcome(Status.PYTHON_ERROR, (), RunError("MemoryError", message))
    try:
        return result_of(*_compile_all([source], literals, skills)[0])
    except IsolatedCallError as error:
        status = STATUSES.get(error.kind, Status.KILLED)
        return Outcome(status, (), RunError(error.kind, error.message))


def compile_programs(
    sources: Sequence[str], literals: str, skills: tuple[str, ...]
) -> list[CompiledProgram | Outcome]:
    """Compile several programs, all in one call of an isolated process if they are short."""
    if len(sources) > 1 and sum(map(len, sources)) <= LONG_SOURCE:
        try:
            return [result_of(*each) for each in _compile_all(sources, literals, skills)]
        except IsolatedCallError:
            pass  # one of them needs too much time or memory
    return [compile_program(source, literals, skills) for source in sources]


def result_of(kind: str, text: str, further: Any) -> CompiledProgram | Outcome:  # noqa: ANN401 - from JSON
    """Convert a result of `compile_here`: code to a CompiledProgram, an error to the outcome of every run."""
    if kind == CODE:
        return CompiledProgram(b64decode(text), further)
    return Outcome(Status.PYTHON_ERROR, (), RunError(kind, text), further)


# --- in the closed process


@isolated([REHEARSAL], "lowercase", ("get_all_rooms", "say"))
def _compile_all(
    sources: Sequence[str], literals: str, skills: tuple[str, ...]
) -> list[tuple[str, str, int | None]]:
    return [compile_here(source, literals, frozenset(skills)) for source in sources]


def compile_here(source: str, literals: str, skills: frozenset[str]) -> tuple[str, str, int | None]:
    """Compile a program in this process, which must be a closed process if the text is untrusted.

    Return CODE, the code in base64, and whether the program may share a process; or the kind, message and
    line of an error. Raise MemoryError if the program, or an earlier one, used up the memory.
    """
    try:
        code, is_tame = prepared(source, lowercase=literals == "lowercase", skills=skills)
        data = dumps(code, WITHOUT_REFERENCES)
    except MemoryError:  # the caller tries again in a new process
        raise
    except SyntaxError as error:
        return type(error).__name__, error.msg[:1000], error.lineno
    except Exception as error:  # noqa: BLE001 - the compiler may raise many errors
        return type(error).__name__, str(error)[:1000], None
    if len(data) > MAX_CODE:
        raise MemoryError(PROGRAM_TOO_LARGE)
    return CODE, b64encode(data).decode(), is_tame
