"""Rows of completions and of evaluations: read with line numbers, written so that no crash loses one."""

from __future__ import annotations

import ast
import hashlib
import io
import json
import lzma
import os
import re
import sys
import zipfile
import zlib
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, BinaryIO, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from codebotler.badinput import BadInput, read_text
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
    prompt: Annotated[int, Field(ge=0)]
    index: Annotated[int, Field(ge=0)]
    program: str
    instruction: str | None = None
    model: str | None = None

    @property
    def key(self) -> Key:
        """What no other row of a run shares."""
        return self.task, self.prompt, self.index

    @property
    def program_sha256(self) -> str:
        """The hash of the program, half surrogate pairs included, in 64 hexadecimal digits."""
        return hashlib.sha256(self.program.encode(errors="surrogatepass")).hexdigest()


# --- reading


def read_rows(
    path: Path, *, limit: int = MAX_ROW, growing: bool = False, name: Path | str | None = None
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Read a file of JSON lines: the line's number, counted from 1, and its object.

    Args:
        path: the file.
        limit: the longest line in bytes.
        growing: whether it is one that we write: then a broken last line without an end was torn by a crash,
            and is passed over.
        name: what sentences call the file; its path by default.

    Raises:
        BadInput: the file is missing, or a line is too long or no JSON object.
    """
    name = name or path
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
            if len(line) > limit:
                raise BadInput(f"this row is longer than {limit:,} bytes", file=name, line=number)
            if line.strip():
                row = _parsed(line, name, number)
                if row is None and growing and not line.endswith(b"\n"):
                    return
                if row is None:
                    raise BadInput("this line is no JSON", file=name, line=number)
                yield number, row


def _count() -> Iterator[int]:
    number = 0
    while True:
        yield (number := number + 1)


def _parsed(line: bytes, name: Path | str, number: int) -> dict[str, Any] | None:
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(row, dict):
        raise BadInput("this line is no JSON object", file=name, line=number)
    return row


def read_completions(
    path: Path, suite: Suite | None = None, *, growing: bool = False, name: Path | str | None = None
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
    name = name or path
    seen: dict[tuple[str, int], dict[int, int]] = defaultdict(dict)  # lines by index: small for many rows
    for number, row in read_rows(path, growing=growing, name=name):
        try:
            completion = Completion.model_validate(row)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            what = "is missing" if first["type"] == "missing" else f"is wrong: {first['msg'].lower()}"
            field = ".".join(map(str, first["loc"]))
            raise BadInput(f'"{field}" {what}', file=name, line=number) from None
        lines = seen[sys.intern(completion.task), completion.prompt]
        first_line = lines.setdefault(completion.index, number)
        if first_line != number:
            raise BadInput(
                f"{name_of(completion.key)} stands here again; it stood in line {first_line} already",
                file=name,
                line=number,
            )
        if suite is not None and (problem := _unknown(completion.key, suite)):
            raise BadInput(problem, file=name, line=number)
        yield completion
    if not seen:
        raise BadInput("there is no completion in it", file=name)


def read_evaluations(path: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    """Read the rows of an evaluation with the numbers of their lines.

    Raises:
        BadInput: the file is missing, or a line is no row of an evaluation.
    """
    for number, row in read_rows(path, limit=MAX_EVALUATION, growing=True):
        if not (row.keys() >= EVALUATED.keys() and all(isinstance(row[f], t) for f, t in EVALUATED.items())):
            raise BadInput("this line is no row of an evaluation; --redo starts over", file=path, line=number)
        yield number, row


EVALUATED = {
    "task": str,
    "prompt": int,
    "index": int,
    "passed": bool,
    "failure": dict | None,
    "verdicts": list,
}
HASH_LINE = 65  # bytes: 64 hexadecimal digits and a line end


def read_judged(rows: Path, programs: Path) -> Iterator[tuple[int, dict[str, Any], str | None]]:
    """Read the rows of an evaluation with the numbers of their lines and the hashes of their programs.

    Args:
        rows: the file of the rows.
        programs: the file that holds, for each row in order, the hash of the program that it judges.

    Raises:
        BadInput: the rows are missing, or a line is no row of an evaluation.
    """
    hashes = programs.open("rb") if programs.exists() else io.BytesIO()
    with hashes:
        for number, row in read_evaluations(rows):
            line = hashes.read(HASH_LINE)
            whole = len(line) == HASH_LINE
            yield number, row, line.decode(errors="replace").rstrip("\n") if whole else None


def _unknown(key: Key, suite: Suite) -> str | None:
    """What is wrong with a completion's task or prompt; None if the suite knows both."""
    task = suite.tasks.get(key[0])
    if task is None:
        return f'the suite has no task "{key[0]}"; its tasks are {", ".join(suite.tasks)}'
    if key[1] >= len(task.prompts):
        return f"{name_of(key)}: the task has prompts 0 to {len(task.prompts) - 1}"
    return None


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


UNREADABLE = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    UnicodeDecodeError,
    NotImplementedError,
    RuntimeError,
    EOFError,
    OSError,
)
PUBLISHED = re.compile(r"(?P<task>[A-Za-z]\w*?)_(?P<prompt>\d{1,9})_(?P<index>\d{1,9})\.py", re.ASCII)


def published_completions(path: Path, suite: Suite | None = None) -> Iterator[Completion]:
    """Read a folder or zip of `TASK_PROMPT_INDEX.py`, as the paper's authors published theirs.

    The files assign texts to `name`, `prompt` and `completion`; they are parsed and never imported.

    Args:
        path: the folder or zip.
        suite: whose tasks and prompts they must be of; any by default.

    Raises:
        BadInput: it holds no such file, or one of them is wrong or unknown to the suite.
    """
    files = _zipped(path) if path.is_file() else _in_folder(path)
    found = [(match, name, text) for name, text in files if (match := PUBLISHED.fullmatch(Path(name).name))]
    if not found:
        raise BadInput("there is no file named TASK_PROMPT_INDEX.py in it", file=path)
    found.sort(key=lambda item: (item[0]["task"], int(item[0]["prompt"]), int(item[0]["index"])))
    seen: dict[Key, str] = {}
    for match, name, text in found:
        key = match["task"], int(match["prompt"]), int(match["index"])
        if key in seen:
            raise BadInput(f"{name_of(key)} stands here again; {seen[key]} holds it already", file=name)
        seen[key] = name
        if suite is not None and (problem := _unknown(key, suite)):
            raise BadInput(problem, file=name)
        values = _assigned(text, name)
        yield Completion(
            task=key[0],
            prompt=key[1],
            index=key[2],
            instruction=values.get("prompt"),
            program=values["completion"],
        )


def _in_folder(path: Path) -> Iterator[tuple[str, str]]:
    for file in sorted(path.rglob("*.py")):
        yield str(file), read_text(file, limit=MAX_ROW)


def _zipped(path: Path) -> Iterator[tuple[str, str]]:
    try:
        with zipfile.ZipFile(path) as archive:
            for member in archive.infolist():
                name = PurePosixPath(member.filename)
                if name.is_absolute() or ".." in name.parts:
                    raise BadInput(f'the zip names a file outside itself, "{member.filename}"', file=path)
                if member.file_size > MAX_ROW:
                    raise BadInput(f'"{member.filename}" is larger than {MAX_ROW:,} bytes', file=path)
                if name.suffix == ".py":
                    yield f"{path}/{member.filename}", archive.read(member).decode()
    except UNREADABLE as error:
        raise BadInput(f"is no readable zip ({error})", file=path) from None


def _assigned(text: str, name: str) -> dict[str, str]:
    try:
        statements = ast.parse(text).body
        values = {
            target.id: ast.literal_eval(statement.value)
            for statement in statements
            if isinstance(statement, ast.Assign)
            for target in statement.targets
            if isinstance(target, ast.Name) and target.id in ("name", "prompt", "completion")
        }
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise BadInput(f"cannot be read as assignments of texts ({error})", file=name) from None
    if not isinstance(values.get("completion"), str):
        raise BadInput("does not assign a text to `completion`", file=name)
    return {key: value for key, value in values.items() if isinstance(value, str)}


# --- writing


def to_line(row: dict[str, Any]) -> bytes:
    """A row as a line of JSON, in UTF-8 where that is possible."""
    try:
        return json.dumps(row, ensure_ascii=False).encode() + b"\n"
    except UnicodeEncodeError:  # half of a surrogate pair, which JSON can escape and UTF-8 cannot hold
        return json.dumps(row).encode() + b"\n"


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
        except OSError as error:
            self._file.truncate(start)
            raise OSError(error.errno, error.strerror, str(self.path)) from None

    def cut(self, length: int) -> None:
        """Drop what stands after so many bytes."""
        if self.path.stat().st_size > length:
            self._file.truncate(length)

    def close(self) -> None:
        """Bring everything to the disk."""
        with self._file:
            try:
                os.fsync(self._file.fileno())
            except OSError as error:
                raise OSError(error.errno, error.strerror, str(self.path)) from None


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
