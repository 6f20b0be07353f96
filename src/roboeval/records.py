"""Rows of completions and of evaluations: read with line numbers, written so that no crash loses one."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, BinaryIO, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from codebotler.badinput import BadInput
from codebotler.models.recorded import recorded_model
from roboeval.suite import Suite

MAX_ROW = 5_000_000
MAX_EVALUATION = 1_000_000_000  # of our own rows: a trace may be a million characters in each of many worlds
COMPLETIONS = "completions.jsonl"

Key: TypeAlias = tuple[str, int, int]


class Completion(BaseModel):
    """One row of completions.jsonl: a program that a model wrote for an instruction.

    Args:
        task: the task's name.
        prompt: which phrasing, counted from 0.
        index: which sample, counted from 0.
        program: the cleaned source; judged exactly as it stands.
        instruction: what the model was told; None where nobody recorded it.
        model: who wrote it.
    """

    model_config = ConfigDict(extra="allow", frozen=True, strict=True)

    task: str
    prompt: Annotated[int, Field(ge=0, lt=1_000_000_000)]
    index: Annotated[int, Field(ge=0, lt=1_000_000_000)]
    program: str
    instruction: str | None = None
    model: str | None = None

    @property
    def key(self) -> Key:
        """What no other row of a run shares."""
        return self.task, self.prompt, self.index


# --- reading


def read_rows(
    path: Path, *, limit: int = MAX_ROW, growing: bool = False
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Read a file of JSON lines: the line's number, counted from 1, and its object.

    Args:
        path: the file.
        limit: the longest line in bytes.
        growing: whether it is one that we write: then a broken last line without an end was torn by a crash,
            and is passed over.

    Raises:
        BadInput: the file is missing, or a line is too long or no JSON object.
    """
    try:
        file = path.open("rb")
    except FileNotFoundError:
        raise BadInput("there is no such file", file=path) from None
    except OSError as error:
        raise BadInput(f"cannot be read ({error.strerror})", file=path) from None
    with file:
        for number in _count():
            line = file.readline(limit + 1)
            if not line:
                return
            if len(line) > limit:
                raise BadInput(f"this row is longer than {limit:,} bytes", file=path, line=number)
            if line.strip():
                row = _parsed(line, path, number)
                if row is None and growing and not line.endswith(b"\n"):
                    return
                if row is None:
                    raise BadInput("this line is no JSON", file=path, line=number)
                yield number, row


def _count() -> Iterator[int]:
    number = 0
    while True:
        yield (number := number + 1)


def _parsed(line: bytes, path: Path, number: int) -> dict[str, Any] | None:
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(row, dict):
        raise BadInput("this line is no JSON object", file=path, line=number)
    return row


def read_completions(path: Path, *, growing: bool = False) -> Iterator[Completion]:
    """Read completions from a file of JSON lines.

    Args:
        path: the file.
        growing: whether it stands in a run, where a torn last line is passed over.

    Raises:
        BadInput: the file is missing or empty, or a row is wrong or repeats another.
    """
    seen: dict[Key, int] = {}
    for number, row in read_rows(path, growing=growing):
        try:
            completion = Completion.model_validate(row)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            what = "is missing" if first["type"] == "missing" else f"is wrong: {first['msg'].lower()}"
            field = ".".join(map(str, first["loc"]))
            raise BadInput(f'"{field}" {what}', file=path, line=number) from None
        if completion.key in seen:
            first_line = seen[completion.key]
            raise BadInput(
                f"{name_of(completion.key)} stands here again; it stood in line {first_line} already",
                file=path,
                line=number,
            )
        seen[completion.key] = number
        check_length(row, path, number)
        yield completion
    if not seen:
        raise BadInput("there is no completion in it", file=path)


def check_length(row: Mapping[str, Any], file: object, line: int | None = None) -> None:
    """Refuse what would be too long to be read again once it is copied into a run.

    Raises:
        BadInput: it is.
    """
    if len(to_line(row)) > MAX_ROW:
        sentence = f"as a row this is longer than {MAX_ROW:,} bytes; shorten the program"
        raise BadInput(sentence, file=str(file), line=line)


def read_evaluations(path: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    """Read the rows of an evaluation with the numbers of their lines.

    Raises:
        BadInput: the file is missing, or a line is no row of an evaluation.
    """
    for number, row in read_rows(path, limit=MAX_EVALUATION, growing=True):
        if not row.keys() >= {"task", "prompt", "index", "passed", "failure", "verdicts"}:
            raise BadInput("this line is no row of an evaluation; --redo starts over", file=path, line=number)
        yield number, row


def check_known(completions: Iterable[Completion], suite: Suite, source: object) -> Iterator[Completion]:
    """Pass completions on whose task and prompt the suite knows.

    Raises:
        BadInput: the suite has no such task, or the task no such prompt.
    """
    for completion in completions:
        task = suite.tasks.get(completion.task)
        if task is None:
            known = ", ".join(suite.tasks)
            raise BadInput(
                f'the suite has no task "{completion.task}"; its tasks are {known}', file=str(source)
            )
        if completion.prompt >= len(task.prompts):
            raise BadInput(
                f"{name_of(completion.key)}: the task has prompts 0 to {len(task.prompts) - 1}",
                file=str(source),
            )
        yield completion


def name_of(key: Key) -> str:
    """How a person names a row: TASK/PROMPT/INDEX."""
    return "/".join(map(str, key))


def recorded_completions(name: str, suite: Suite) -> Iterator[Completion]:
    """Every reply that a recorded model has for a suite's prompts, as completions.

    Raises:
        BadInput: there is no such model, or it knows none of the suite's instructions.
    """
    model = recorded_model(name)
    found = False
    for task in suite.tasks.values():
        for prompt, instruction in enumerate(task.prompts):
            for index, reply in enumerate(model.replies.get(instruction, ())):
                found = True
                yield Completion(
                    task=task.name,
                    prompt=prompt,
                    index=index,
                    instruction=instruction,
                    model=f"recorded:{model.name}",
                    program=reply.program,
                )
    if not found:
        raise BadInput(f'{name} knows no instruction of the suite "{suite.name}"')


# --- writing


def to_line(row: Mapping[str, Any]) -> bytes:
    """A row as a line of JSON, in UTF-8."""
    # Half of a surrogate pair, which UTF-8 cannot hold, becomes an escape, which JSON reads.
    return json.dumps(row, ensure_ascii=False).encode(errors="backslashreplace") + b"\n"


@dataclass
class Appender:
    """Appends whole lines to a file; what a crash leaves torn is cut off when it is opened.

    Args:
        path: the file.
    """

    path: Path

    def __post_init__(self) -> None:
        self._file: BinaryIO = self.path.open("ab", buffering=0)
        whole = whole_length(self.path)
        if self.path.stat().st_size > whole:
            self._file.truncate(whole)

    def append(self, line: bytes) -> None:
        """Add a line, whole or not at all.

        Raises:
            OSError: the disk is full; nothing of the line stays.
        """
        start = self._file.seek(0, os.SEEK_END)
        view = memoryview(line)
        try:
            while view:
                view = view[self._file.write(view) :]
        except OSError:
            self._file.truncate(start)
            raise

    def close(self) -> None:
        """Bring everything to the disk."""
        os.fsync(self._file.fileno())
        self._file.close()


def whole_length(path: Path) -> int:
    """How many bytes of a file of lines are whole lines."""
    with path.open("rb") as file:
        position = file.seek(0, os.SEEK_END)
        while position > 0:
            start = max(0, position - (1 << 16))
            file.seek(start)
            end = file.read(position - start).rfind(b"\n")
            if end >= 0:
                return start + end + 1
            position = start
    return 0
