"""Completions as the paper's authors published theirs: a folder or zip of small Python files."""

from __future__ import annotations

import ast
import re
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path, PurePosixPath
from typing import TypeAlias

from codebotler.badinput import BadInput, read_text, text_of
from codebotler.files import MAX_ROW
from codebotler.syntaxtree import parse
from roboeval.evaluation.completions import Completion, Key, check_length, name_of, unknown
from roboeval.suites.load import Suite

MAX_ZIP = 100_000_000
MAX_UNPACKED = 1_000_000_000
NAME = re.compile(r"(?P<task>[A-Za-z]\w*?)_(?P<prompt>\d{1,9})_(?P<index>\d{1,9})\.py", re.ASCII)
NAMED = "TASK_PROMPT_INDEX.py, such as LunchTime_0_1.py"
UNREADABLE = (zipfile.BadZipFile, zlib.error, NotImplementedError, EOFError, OSError, ValueError)

Read: TypeAlias = Callable[[], str]
"""Reads one file's text when it is called."""


def published_completions(path: Path, suite: Suite | None = None) -> Iterator[Completion]:
    """Read a folder or zip of `TASK_PROMPT_INDEX.py`, one file at a time; other files are passed over.

    The files assign texts to `name`, `prompt` and `completion`; they are parsed and never imported.

    Args:
        path: the folder or zip.
        suite: whose tasks and prompts they must be of; any by default.

    Raises:
        BadInput: it holds no such file, one of them is wrong or unknown to the suite, or a zip is damaged,
            encrypted or too large.
    """
    with ExitStack() as open_files:
        files = _zipped(path, open_files) if path.is_file() else _in_folder(path)
        for key, (name, read) in sorted(_by_key(files, path).items()):
            if suite is not None and (problem := unknown(key, suite)):
                raise BadInput(problem, file=name)
            values = _assigned(read(), name)
            completion = Completion(
                task=key[0],
                prompt=key[1],
                index=key[2],
                instruction=values.get("prompt"),
                program=values["completion"],
            )
            check_length(completion.row, name)
            yield completion


def passed_over(path: Path) -> str | None:
    """What is to be said of the Python files that are not named as completions are; None if all are.

    Args:
        path: a folder or zip that has been read.
    """
    with ExitStack() as open_files:
        files = _zipped(path, open_files) if path.is_file() else _in_folder(path)
        names = [name for name, _ in files if name.endswith(".py") and not _match(name)]
    if not names:
        return None
    they = "file was" if len(names) == 1 else "files were"
    which = names[0] if len(names) == 1 else f"{names[0]} the first"
    return f"{len(names):,} {they} left aside, {which}; a completion is named {NAMED}"


def _match(name: str) -> re.Match[str] | None:
    return NAME.fullmatch(PurePosixPath(name).name)


def _by_key(files: Iterable[tuple[str, Read]], path: Path) -> dict[Key, tuple[str, Read]]:
    found: dict[Key, tuple[str, Read]] = {}
    for name, read in files:
        match = _match(name)
        if match is None:
            continue
        key = match["task"], int(match["prompt"]), int(match["index"])
        if key in found:
            raise BadInput(f"{name_of(key)} stands here again; {found[key][0]} holds it already", file=name)
        found[key] = name, read
    if not found:
        raise BadInput(f"there is no file named {NAMED}, in it", file=path)
    return found


def _in_folder(path: Path) -> Iterator[tuple[str, Read]]:
    for file in sorted(path.rglob("*.py")):
        if file.is_file():
            yield str(file), partial(read_text, file, limit=MAX_ROW)


def _zipped(path: Path, open_files: ExitStack) -> Iterator[tuple[str, Read]]:
    if path.stat().st_size > MAX_ZIP:
        raise BadInput(f"is larger than {MAX_ZIP:,} bytes", file=path)
    try:
        archive = open_files.enter_context(zipfile.ZipFile(path))
    except UNREADABLE as error:
        raise BadInput(f"is no readable zip ({error})", file=path) from None
    members = _Members(path, archive)
    for member in archive.infolist():
        name = PurePosixPath(member.filename)
        if name.is_absolute() or ".." in name.parts:
            raise BadInput(f'the zip names a file outside itself, "{member.filename}"', file=path)
        if not member.is_dir():
            yield f"{path}/{member.filename}", partial(members.read, member)


class _Members:
    """Reads members of a zip, which may say anything about their sizes.

    Args:
        path: of the zip.
        archive: the open zip.
    """

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        self.path, self.archive, self.unpacked = path, archive, 0

    def read(self, member: zipfile.ZipInfo) -> str:
        """The text of a member, unpacked no further than it may be long.

        Raises:
            BadInput: it is encrypted, damaged, too large or no UTF-8, or too much has been unpacked.
        """
        name = f"{self.path}/{member.filename}"
        if member.flag_bits & 1:
            raise BadInput("is encrypted; pack it without a password", file=name)
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            # Others are unpacked in pieces that may be of any size.
            raise BadInput('is packed in an unusual way; pack it with "deflate"', file=name)
        try:
            with self.archive.open(member) as file:
                data = file.read(MAX_ROW + 1)
        except (*UNREADABLE, RuntimeError) as error:
            raise BadInput(f"is no readable zip ({error})", file=self.path) from None
        self.unpacked += len(data)
        if self.unpacked > MAX_UNPACKED:
            raise BadInput(f"unpacks to more than {MAX_UNPACKED:,} bytes", file=self.path)
        return text_of(data, name, limit=MAX_ROW)


def _assigned(text: str, name: str) -> dict[str, str]:
    try:
        statements = parse(text).body
    except SyntaxError as error:
        raise BadInput(f"is no Python ({error.msg})", file=name, line=error.lineno) from None
    except (ValueError, RecursionError, MemoryError):
        raise BadInput("is no readable Python; write plain assignments", file=name) from None
    values = {
        target.id: _value(statement.value, target.id, name)
        for statement in statements
        if isinstance(statement, ast.Assign | ast.AnnAssign) and statement.value is not None
        for target in (statement.targets if isinstance(statement, ast.Assign) else [statement.target])
        if isinstance(target, ast.Name) and target.id in ("name", "prompt", "completion")
    }
    if not isinstance(values.get("completion"), str):
        raise BadInput("does not assign a text to `completion`", file=name)
    return {key: _joined(value) for key, value in values.items() if isinstance(value, str)}


def _value(written: ast.expr, what: str, name: str) -> object:
    try:
        return ast.literal_eval(written)
    except (ValueError, TypeError, RecursionError, MemoryError):
        sentence = f"`{what}` is no plain text; write the text out"
        raise BadInput(sentence, file=name, line=written.lineno) from None


def _joined(text: str) -> str:
    """A text as JSON will hold it, in which both halves of a surrogate pair are one character."""
    return text.encode("utf-16", errors="surrogatepass").decode("utf-16", errors="surrogatepass")
