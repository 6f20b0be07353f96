"""Rows of completions and of evaluations: read with line numbers, written so that no crash loses one."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from os import PathLike
from pathlib import Path
from typing import Any, BinaryIO, SupportsIndex, TypeAlias, TypedDict

from codebotler.arguments import expect_text, expect_whole
from codebotler.badinput import BadInput
from codebotler.english import counted
from codebotler.models.recorded import recorded_model
from roboeval.suite import Suite, expect_suite

MAX_ROW = 5_000_000
COMPLETIONS = "completions.jsonl"
EXAMPLE = '{"task": "LunchTime", "prompt": 0, "index": 0, "program": "def task_program(): ..."}'
CANNOT_SYNC = (errno.EINVAL, errno.ENOTSUP)  # says a file system that brings no folder to the disk

MOST = 1_000_000_000
REQUIRED = ("task", "prompt", "index", "program")
FIELDS = (*REQUIRED, "instruction", "model")

Key: TypeAlias = tuple[str, int, int]


@dataclass(frozen=True, kw_only=True)
class Completion:
    """One row of completions.jsonl: a program that a model wrote for an instruction.

    Args:
        task: the task's name.
        prompt: which phrasing, counted from 0, below a billion.
        index: which sample, counted from 0, below a billion.
        program: the cleaned source; judged exactly as it stands.
        instruction: what the model was told; None where nobody recorded it.
        model: who wrote it.
        more: what else its row says, such as `usage`.

    Raises:
        BadInput: one of them is not of its kind or range.
    """

    task: str
    prompt: int
    index: int
    program: str = field(repr=False)
    instruction: str | None = field(default=None, repr=False)
    model: str | None = None
    more: Mapping[str, Any] = field(default_factory=dict, repr=False, hash=False)

    def __post_init__(self) -> None:
        expect_text(self.task, "the task")
        for name, number in (("prompt", self.prompt), ("index", self.index)):
            expect_whole(number, f"the {name}", least=0)
            if number >= MOST:
                raise BadInput(f"the {name} is {number}, but it must be below {MOST:,}")
            if type(number) is not int:  # but of a library's kind, which JSON cannot write
                object.__setattr__(self, name, int(number))
        expect_text(self.program, "the program")
        if self.instruction is not None:
            expect_text(self.instruction, "the instruction")
        if self.model is not None:
            expect_text(self.model, "the model")

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> Completion:
        """The completion that a row of completions.jsonl says.

        Raises:
            BadInput: something is missing in it, or not of its kind or range.
        """
        more = dict(row)
        known = {name: more.pop(name) for name in FIELDS if name in more}
        for name in REQUIRED:
            if name not in known:
                raise BadInput(f'"{name}" is missing')
        return cls(**known, more=more)

    @property
    def row(self) -> dict[str, Any]:
        """The row of completions.jsonl that says it."""
        known = {name: getattr(self, name) for name in FIELDS}
        return {name: value for name, value in known.items() if value is not None} | dict(self.more)

    @property
    def key(self) -> Key:
        """What no other row of a run shares."""
        return self.task, self.prompt, self.index

    @property
    def program_sha256(self) -> str:
        """The hash of the program, half surrogate pairs included, in 64 hexadecimal digits."""
        return hashlib.sha256(self.program.encode(errors="surrogatepass")).hexdigest()


class Judgement(TypedDict):
    """What is said of a program.

    Args:
        passed: whether the program does what is required in all worlds.
        failure: `class`, `kind`, `world` and `check` of the first failure; None if it passed.
        verdicts: for each world, in order, what happened there: `world`, `satisfied`, `status`, `error`,
            `line`, `failed_checks` and `trace`; where the trace is too long for a row, it ends early, and
            `cut` says how many `events` more there are, and the `sha256` of the JSON of all of it.
    """

    passed: bool
    failure: dict[str, Any] | None
    verdicts: list[dict[str, Any]]


class Row(Judgement):
    """One row of an evaluation: what is said of a completion's program.

    Args:
        task: the task's name.
        prompt: which phrasing, counted from 0.
        index: which sample, counted from 0.
    """

    task: str
    prompt: int
    index: int


# --- reading


def read_rows(
    path: Path,
    *,
    limit: int = MAX_ROW,
    growing: bool = False,
    name: Path | str | None = None,
    example: str | None = None,
    see: Callable[[bytes], None] = lambda _: None,
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Read a file of JSON lines: the line's number, counted from 1, and its object.

    Args:
        path: the file.
        limit: the longest line in bytes.
        growing: whether it is one that we write: then a broken last line without an end was torn by a crash,
            and is passed over.
        name: what sentences call the file; its path by default.
        example: a row, for who does not know what one looks like.
        see: gets every line as it stands there.

    Raises:
        BadInput: the file is missing, or a line is too long or no JSON object.
    """
    name = name or path
    mend = "" if example is None else f"; a row looks like {example}"
    try:
        file = path.open("rb")
    except FileNotFoundError:
        raise BadInput("there is no such file", file=name) from None
    except OSError as error:
        raise BadInput(f"cannot be read ({error.strerror})", file=name) from None
    with file:
        for number in _count():
            line = file.readline(limit + 1)
            if not line:
                return
            see(line)
            if len(line) > limit:
                raise BadInput(f"this row is longer than {limit:,} bytes", file=name, line=number)
            if line.strip():
                row = _parsed(line, name, number, mend)
                if row is None and growing and not line.endswith(b"\n"):
                    return
                if row is None:
                    raise BadInput(f"this line is no JSON{mend}", file=name, line=number)
                yield number, row


def _count() -> Iterator[int]:
    number = 0
    while True:
        yield (number := number + 1)


def _parsed(line: bytes, name: Path | str, number: int, mend: str) -> dict[str, Any] | None:
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(row, dict):
        raise BadInput(f"this line is no JSON object{mend}", file=name, line=number)
    return row


def read_completions(
    path: str | PathLike[str],
    suite: Suite | None = None,
    *,
    growing: bool = False,
    name: Path | str | None = None,
) -> Iterator[Completion]:
    """Read completions from a file of JSON lines.

    Args:
        path: the file.
        suite: whose tasks and prompts they must be of; any by default.
        growing: whether it stands in a run, where a torn last line is passed over.
        name: what sentences call the file; its path by default.

    Raises:
        BadInput: the file is missing or empty, or a row is wrong, unknown to the suite, or repeats another.
    """
    if not isinstance(path, PathLike):
        expect_text(path, "the path")
    path = Path(path)
    name = name or path
    if suite is not None:
        expect_suite(suite)
    seen: dict[tuple[str, int], dict[int, int]] = defaultdict(dict)  # lines by index: small for many rows
    for number, row in read_rows(path, growing=growing, name=name, example=EXAMPLE):
        try:
            completion = Completion.of(row)
        except BadInput as error:
            raise BadInput(error.sentence, file=name, line=number) from None
        lines = seen[sys.intern(completion.task), completion.prompt]
        first_line = lines.setdefault(completion.index, number)
        if first_line != number:
            raise BadInput(
                f"{name_of(completion.key)} stands here again; it stood in line {first_line} already",
                file=name,
                line=number,
            )
        check_length(row, name, number)
        if suite is not None and (problem := unknown(completion.key, suite)):
            raise BadInput(problem, file=name, line=number)
        yield completion
    if not seen:
        raise BadInput("there is no completion in it", file=name)


def check_length(row: Mapping[str, Any], file: object, line: int | None = None) -> None:
    """Refuse what would be too long to be read again once it is copied into a run.

    Raises:
        BadInput: it is.
    """
    if len(to_line(row)) > MAX_ROW:
        sentence = f"as a row this is longer than {MAX_ROW:,} bytes; shorten the program"
        raise BadInput(sentence, file=str(file), line=line)


def unknown(key: Key, suite: Suite) -> str | None:
    """What is wrong with a completion's task or prompt; None if the suite knows both.

    Args:
        key: the completion's, as a row or somebody who writes Python gives it.
        suite: whose tasks and prompts are known.
    """
    task = suite.tasks.get(str(key[0]))
    if task is None:
        return f'the suite "{suite.name}" has no task "{key[0]}"; its tasks are {", ".join(suite.tasks)}'
    there_are = f"the task has prompts 0 to {len(task.prompts) - 1}"
    if not _is_whole(key[1]):
        return f"the prompt is {key[1]!r}, not a whole number; {there_are}"
    if not 0 <= key[1] < len(task.prompts):
        return f"{name_of(key)}: {there_are}"
    return None


def _is_whole(number: object) -> bool:
    """Whether it is a whole number, of any library's kind."""
    return isinstance(number, SupportsIndex) and not isinstance(number, bool)


def name_of(key: Key) -> str:
    """How a person names a row: TASK/PROMPT/INDEX."""
    return "/".join(map(str, key))


def how_many(count: int) -> str:
    """A number of completions: `1 completion`, `2,000 completions`."""
    return counted(count, "completion")


def recorded_completions(name: str, suite: Suite) -> Iterator[Completion]:
    """Every reply that a recorded model has for a suite's prompts, as completions.

    Raises:
        BadInput: there is no such model or suite, or the model knows none of its instructions.
    """
    expect_text(name, "the model's name")
    expect_suite(suite)
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


def to_line(row: object) -> bytes:
    """A row, or a part of one, as a line of JSON, in UTF-8."""
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
        is_new = not self.path.exists()
        self._file: BinaryIO = self.path.open("ab", buffering=0)
        if is_new:
            sync_folder(self.path.parent)
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
        except OSError as error:
            self._file.truncate(start)
            raise OSError(error.errno, error.strerror, str(self.path)) from None

    def cut(self, length: int) -> None:
        """Drop what stands after so many bytes."""
        if self.path.stat().st_size > length:
            self._file.truncate(length)

    def sync(self) -> None:
        """Bring everything to the disk; may be called from another thread.

        Raises:
            OSError: that is not possible.
        """
        try:
            os.fsync(self._file.fileno())
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self.path)) from None

    def close(self) -> None:
        """Bring everything to the disk, and let go of the file."""
        with self._file:
            self.sync()


def sync_folder(folder: Path) -> None:
    """Bring to the disk which files a folder has, as far as its file system can.

    Else a file whose content is on the disk may be gone after a power failure.

    Raises:
        OSError: the disk is broken.
    """
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except PermissionError:  # a folder that may be written but not read
        return
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in CANNOT_SYNC:
            raise OSError(error.errno, error.strerror, str(folder)) from None
    finally:
        os.close(descriptor)


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


def length_before(path: Path, line: int) -> int:
    """How many bytes of a file stand before a line, counted from 1."""
    with path.open("rb") as file:
        return sum(map(len, islice(file, line - 1)))
