"""Reads completions in the format of the paper's authors: a folder or zip of small Python files."""

from __future__ import annotations

import ast
import re
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path, PurePosixPath
from typing import TypeAlias

from codebotler.core.errors import UserError
from codebotler.core.files import MAX_ROW, decode_text, read_text
from codebotler.core.program import parse
from roboeval.evaluation.runs.completions import (
    KEY,
    Completion,
    CompletionKey,
    check_length,
    find_key_fault,
    name_of,
)
from roboeval.suites.load import Suite

MAX_UNPACKED = 1_000_000_000
PROGRAM_FILE_NAME = re.compile(r"(?P<task>[A-Za-z]\w*?)_(?P<prompt>\d{1,9})_(?P<index>\d{1,9})\.py", re.ASCII)
NAMED = "TASK_PROMPT_INDEX.py, such as LunchTime_0_1.py"
UNREADABLE_ZIP = (zipfile.BadZipFile, zlib.error, RuntimeError, EOFError, OSError, ValueError)

File: TypeAlias = tuple[str, Callable[[], str]]  # the name of a file, and a function that reads it


def published_completions(path: Path, suite: Suite | None = None) -> Iterator[Completion]:
    """Read the completions in a folder or zip of files named `TASK_PROMPT_INDEX.py`.

    The files assign strings to `prompt` and `completion`. They are parsed but never imported. Raises
    UserError if there are none, one is invalid or unknown to the suite, or a zip is damaged or too large.
    """
    with _files(path) as files:
        for key, (name, read) in sorted(_by_key(files, path).items()):
            if suite is not None and (problem := find_key_fault(key, suite)):
                raise UserError(problem, file=name)
            texts = _assigned(read(), name)
            row = dict(zip(KEY, key, strict=True))
            row |= {"program": texts["completion"], "instruction": texts.get("prompt")}
            completion = Completion.of(row)
            check_length(completion.row, name)
            yield completion


def _by_key(files: Iterator[File], path: Path) -> dict[CompletionKey, File]:
    by_key: dict[CompletionKey, File] = {}
    for file in files:
        name = PurePosixPath(file[0]).name
        if name.startswith("."):  # macOS adds hidden files to zips
            continue
        if (match := PROGRAM_FILE_NAME.fullmatch(name)) is None:
            fix = "rename or remove this file"
            raise UserError(f"the name of a completion must be {NAMED}; {fix}", file=file[0])
        key = match["task"], int(match["prompt"]), int(match["index"])
        if key in by_key:
            earlier = f"already defined in {by_key[key][0]}"
            raise UserError(f"duplicates {name_of(key)}, {earlier}; remove one of the two", file=file[0])
        by_key[key] = file
    if not by_key:
        raise UserError(f"there is no file named {NAMED}; choose another folder or zip", file=path)
    return by_key


@contextmanager
def _files(path: Path) -> Iterator[Iterator[File]]:
    if path.is_dir():
        python = (file for file in sorted(path.rglob("*.py")) if file.is_file())
        yield ((str(file), partial(read_text, file, limit=MAX_ROW)) for file in python)
        return
    try:
        archive = zipfile.ZipFile(path)
    except UNREADABLE_ZIP as error:
        raise UserError(f"this is not a readable zip ({error}); create it again", file=path) from None
    with archive:
        yield _members(path, archive)


def _members(path: Path, archive: zipfile.ZipFile) -> Iterator[File]:
    unpacked = 0

    def read(member: zipfile.ZipInfo, name: str) -> str:
        # A zip may declare wrong sizes, so read at most the longest allowed text.
        nonlocal unpacked
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            # Other compression methods may unpack chunks of any size.
            raise UserError('this is compressed in an unusual way; create the zip with "deflate"', file=name)
        try:
            with archive.open(member) as file:
                data = file.read(MAX_ROW + 1)
        except UNREADABLE_ZIP as error:
            raise UserError(f"this is not a readable zip ({error}); create it again", file=path) from None
        unpacked += len(data)
        if unpacked > MAX_UNPACKED:
            raise UserError(f"the zip unpacks to more than {MAX_UNPACKED:,} bytes; split the zip", file=path)
        return decode_text(data, name, limit=MAX_ROW)

    for member in archive.infolist():
        if member.filename.endswith(".py"):
            name = f"{path}/{member.filename}"
            yield name, partial(read, member, name)


def _assigned(text: str, name: str) -> dict[str, str]:
    try:
        statements = parse(text).body
    except SyntaxError as error:
        sentence = f"this file has a syntax error ({error.msg}); correct it"
        raise UserError(sentence, file=name, line=error.lineno) from None
    except (ValueError, RecursionError, MemoryError):
        raise UserError("this file cannot be parsed as Python; write plain assignments", file=name) from None
    texts = {
        target.id: _text(statement.value, target.id, name)
        for statement in statements
        if isinstance(statement, ast.Assign | ast.AnnAssign) and statement.value is not None
        for target in (statement.targets if isinstance(statement, ast.Assign) else [statement.target])
        if isinstance(target, ast.Name) and target.id in ("prompt", "completion")
    }
    if "completion" not in texts:
        raise UserError('the file assigns no string to `completion`; add `completion = "..."`', file=name)
    return texts


def _text(written: ast.expr, what: str, name: str) -> str:
    match written:
        case ast.Constant(str(text)):
            # Join surrogate pairs as JSON does.
            return text.encode("utf-16", errors="surrogatepass").decode("utf-16", errors="surrogatepass")
    fix = "write a single string literal"
    raise UserError(f"`{what}` is not a plain string; {fix}", file=name, line=written.lineno)
