"""Defines and reads the rows of an evaluation, and the hash that reveals changes to a finished file."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NotRequired, TypeAlias, TypedDict

import msgspec

from codebotler.core.errors import UserError
from codebotler.core.files import read_lines, read_rows, to_line
from codebotler.core.trace import Status
from roboeval.evaluation.runs.completions import Completion, CompletionKey, name_of

MAX_LINE_BYTES = 1_000_000_000  # enough for a row with very many worlds
NO_ROW = "this line is not an evaluation row"
BROKEN = "was damaged or changed after the evaluation was finished"
# The group matches escapes of lone surrogates. The alternatives before it match backslashes and whole pairs.
ESCAPES = re.compile(rb"\\\\|\\u[dD][89abAB]..\\u[dD][c-fC-F]..|(\\u[dD][89a-fA-F]..)")


Failure = TypedDict("Failure", {"class": str, "kind": str, "world": int, "check": str | None})
"""Why a completion fails (paper, section V.B).

`class` is a key of `FAILURE_CLASSES`, `world` the first failing world (from 0), `check` None for an error.
"""


class RunErrorData(TypedDict):
    """The error that ended a run: its kind, such as `NameError`, and its message."""

    kind: str
    message: str


class CutTrace(TypedDict):
    """The number of events that did not fit into a row, and the hash of the whole trace as JSON."""

    events: int
    sha256: str


Numbered: TypeAlias = list[Annotated[list[int | str | None], msgspec.Meta(min_length=2, max_length=2)]]


class WorldVerdict(TypedDict):
    """The judgement in one world.

    See `circumstances` for `places`, `holding`, `to` and `destinations`. If the trace is too long for the
    row, only its first events are stored, and `cut` counts the rest.
    """

    world: str
    satisfied: bool
    status: str
    error: RunErrorData | None
    line: int | None
    failed_checks: list[str]
    trace: list[Annotated[list[Any], msgspec.Meta(min_length=2)]]  # a kind, a text and more
    places: Numbered
    holding: NotRequired[Numbered]
    to: NotRequired[Numbered]
    destinations: NotRequired[Numbered]
    cut: NotRequired[CutTrace]


class Row(TypedDict):
    """One row of an evaluation: the judgement on a completion's program.

    Args:
        task: the task's name.
        prompt: the number of the phrasing, from 0.
        index: the number of the sample, from 0.
        program_sha256: the hash of the program that was judged.
        mission_world: the index of the only judged world of an agent's mission; absent for programs.
        passed: whether the program satisfies the requirements in all worlds.
        failure: the first failure, or None if the program passed.
        verdicts: the judgement in each world, in order.
    """

    task: str
    prompt: int
    index: int
    program_sha256: str
    mission_world: NotRequired[int]
    passed: bool
    failure: Failure | None
    verdicts: list[WorldVerdict]


def key_of(row: Mapping[str, Any]) -> CompletionKey:
    """Return the task, prompt and index of a row."""
    return row["task"], row["prompt"], row["index"]


def failure_of(row: Row) -> Failure:
    """Return the failure that a row records. The program must have failed."""
    assert row["failure"] is not None, "this program passed"
    return row["failure"]


def decode_row(line: bytes) -> Row:
    """Decode a line of an evaluation. Raise UserError if the line is not a valid row."""
    try:
        data = _decoded(line)
        row = msgspec.convert(data, Row)
        _expect_consistent(row, data)
    except (msgspec.DecodeError, UnicodeDecodeError, ValueError, TypeError, LookupError) as error:
        raise UserError(f"{NO_ROW} ({error})") from None
    return row


def _decoded(line: bytes) -> object:
    try:
        return msgspec.json.decode(line)
    except msgspec.DecodeError:
        # UTF-8 cannot encode lone surrogates, so keep their escapes as text.
        return msgspec.json.decode(ESCAPES.sub(lambda found: (b"\\" if found[1] else b"") + found[0], line))


def _expect_consistent(row: Row, data: object) -> None:
    if row != data:
        raise ValueError("the row has unknown entries")
    failure = row["failure"]
    if row["passed"] != (failure is None):
        raise ValueError("`failure` must be null if and only if the completion passes")
    if failure is not None and not 0 <= failure["world"] < len(row["verdicts"]):
        raise ValueError("`failure` names a world that does not exist")
    for verdict in row["verdicts"]:
        Status(verdict["status"])


def event_count(verdict: WorldVerdict) -> int:
    """Return the number of events of the whole trace, including those that did not fit into the row."""
    return len(verdict["trace"]) + (verdict["cut"]["events"] if "cut" in verdict else 0)


@dataclass(frozen=True)
class LocatedRow:
    """A row of an evaluation, with its line number, its offset and its size in the file."""

    number: int  # the line number, from 1
    at: int  # the offset in the file, in bytes
    size: int
    row: Row


def read_lines_of(
    path: Path, manifest: Mapping[str, Any], *, seal: Seal | None = None, task: str | None = None
) -> Iterator[LocatedRow]:
    """Yield the rows of an evaluation, of all tasks or of one. Ignore an incomplete last line.

    `seal` counts and hashes all lines. Raises UserError if a line is damaged, or if the file differs from the
    seal in `manifest`, the content of KEY.json.
    """
    name = b"" if task is None else to_line(task).removesuffix(b"\n")
    seal = seal or Seal()
    at = 0
    for number, line in read_lines(path, limit=MAX_LINE_BYTES):
        seal.add(line)
        try:
            if name in line and line.strip():
                yield LocatedRow(number, at, len(line), decode_row(line))
        except UserError as error:
            if not line.endswith(b"\n"):
                break
            raise UserError(f"{error.sentence}; use --redo to judge again", file=path, line=number) from None
        at += len(line)
    if seal.is_broken(manifest):
        raise UserError(f"{BROKEN}; use --redo to judge again", file=path)


def take_judged(left: dict[CompletionKey, Completion], line: LocatedRow, file: Path) -> Completion:
    """Remove the completion that a row judges from `left` (those without a row), and return it.

    Raises UserError if `left` does not contain the completion, or if its program has changed since.
    """
    key = key_of(line.row)
    completion = left.pop(key, None)
    if completion is not None and completion.program_sha256 == line.row["program_sha256"]:
        return completion
    sentence = f"this row judges {name_of(key)}, which the run lacks or an earlier row judges"
    if completion is not None:
        sentence = f"the program of {name_of(key)} has changed since it was judged"
    raise UserError(f"{sentence}; use --redo to judge again", file=file, line=line.number)


def read_checks(path: Path) -> Iterator[tuple[tuple[str, str], list[str]]]:
    """Yield (task, hash) of each checked program, and its problems as sentences ([] if it was accepted)."""
    for number, row in read_rows(path):
        match row:
            case {"task": str(task), "program_sha256": str(program), "problems": list(problems)}:
                yield (task, program), problems
            case _:
                raise UserError("this line is not a check result; delete the file", file=path, line=number)


class Seal:
    """Counts and hashes the rows of an evaluation. KEY.json stores the result, to detect later changes."""

    def __init__(self) -> None:
        self._count, self._hash = 0, hashlib.sha256()

    def add(self, line: bytes) -> None:
        """Add a line to the count and the hash."""
        self._count += bool(line.strip())
        self._hash.update(line)

    def data(self) -> dict[str, Any]:
        """Return the entries of KEY.json for the seal: `rows` (their number) and `sha256`."""
        return {"rows": self._count, "sha256": self._hash.hexdigest()}

    def is_broken(self, manifest: Mapping[str, Any]) -> bool:
        """Return whether the rows differ from those sealed in `manifest`, the content of KEY.json."""
        return is_sealed(manifest) and any(manifest.get(name) != value for name, value in self.data().items())


def is_sealed(manifest: Mapping[str, Any]) -> bool:
    """Return whether `manifest`, the content of KEY.json, belongs to a finished evaluation."""
    return "rows" in manifest or "sha256" in manifest
