"""Completions as the paper's authors published theirs: a folder or zip of small Python files."""

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
from roboeval.evaluation.runs.completions import KEY, Completion, Key, check_length, name_of, unknown
from roboeval.suites.load import Suite

MAX_UNPACKED = 1_000_000_000
NAME = re.compile(r"(?P<task>[A-Za-z]\w*?)_(?P<prompt>\d{1,9})_(?P<index>\d{1,9})\.py", re.ASCII)
NAMED = "TASK_PROMPT_INDEX.py, such as LunchTime_0_1.py"
UNREADABLE = (zipfile.BadZipFile, zlib.error, RuntimeError, EOFError, OSError, ValueError)

File: TypeAlias = tuple[str, Callable[[], str]]  # its name, and what reads its text


def published_completions(path: Path, suite: Suite | None = None) -> Iterator[Completion]:
    """The completions in a folder or zip of `TASK_PROMPT_INDEX.py`, of prompts that a suite knows.

    The files assign texts to `prompt` and `completion`; they are parsed and never imported. Raises UserError
    if there is none, one is wrong or unknown to the suite, or a zip is damaged, encrypted or too large.
    """
    with _files(path) as files:
        for key, (name, read) in sorted(_by_key(files, path).items()):
            if suite is not None and (problem := unknown(key, suite)):
                raise UserError(problem, file=name)
            texts = _assigned(read(), name)
            row = dict(zip(KEY, key, strict=True))
            row |= {"program": texts["completion"], "instruction": texts.get("prompt")}
            completion = Completion.of(row)
            check_length(completion.row, name)
            yield completion


def passed_over(path: Path) -> str | None:
    """A warning about Python files in a folder or zip that are not named as completions are, if any."""
    with _files(path) as files:
        names = [name for name, _ in files if name.endswith(".py") and not _match(name)]
    if not names:
        return None
    they = "file was" if len(names) == 1 else "files were"
    which = names[0] if len(names) == 1 else f"{names[0]} the first"
    return f"{len(names):,} {they} left aside, {which}; a completion is named {NAMED}"


def _match(name: str) -> re.Match[str] | None:
    return NAME.fullmatch(PurePosixPath(name).name)


def _by_key(files: Iterator[File], path: Path) -> dict[Key, File]:
    by_key: dict[Key, File] = {}
    for file in files:
        if match := _match(file[0]):
            key = match["task"], int(match["prompt"]), int(match["index"])
            if key in by_key:
                sentence = f"{name_of(key)} is here again; it was already in {by_key[key][0]}"
                raise UserError(sentence, file=file[0])
            by_key[key] = file
    if not by_key:
        raise UserError(f"there is no file named {NAMED}, in it", file=path)
    return by_key


@contextmanager
def _files(path: Path) -> Iterator[Iterator[File]]:
    if path.is_dir():
        python = (file for file in sorted(path.rglob("*.py")) if file.is_file())
        yield ((str(file), partial(read_text, file, limit=MAX_ROW)) for file in python)
        return
    try:
        archive = zipfile.ZipFile(path)
    except UNREADABLE as error:
        raise UserError(f"is not a readable zip ({error})", file=path) from None
    with archive:
        yield _members(path, archive)


def _members(path: Path, archive: zipfile.ZipFile) -> Iterator[File]:
    unpacked = 0

    def read(member: zipfile.ZipInfo, name: str) -> str:
        """Its text, unpacked no further than it may be long: a zip may lie about its sizes."""
        nonlocal unpacked
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            # Others are unpacked in pieces that may be of any size.
            raise UserError('is packed in an unusual way; pack it with "deflate"', file=name)
        try:
            with archive.open(member) as file:
                data = file.read(MAX_ROW + 1)
        except UNREADABLE as error:
            raise UserError(f"is not a readable zip ({error})", file=path) from None
        unpacked += len(data)
        if unpacked > MAX_UNPACKED:
            raise UserError(f"unpacks to more than {MAX_UNPACKED:,} bytes", file=path)
        return decode_text(data, name, limit=MAX_ROW)

    for member in archive.infolist():
        if not member.is_dir():
            name = f"{path}/{member.filename}"
            yield name, partial(read, member, name)


def _assigned(text: str, name: str) -> dict[str, str]:
    """The texts that a file assigns to `prompt` and `completion`."""
    try:
        statements = parse(text).body
    except SyntaxError as error:
        raise UserError(f"is not Python ({error.msg})", file=name, line=error.lineno) from None
    except (ValueError, RecursionError, MemoryError):
        raise UserError("is not readable Python; write plain assignments", file=name) from None
    texts = {
        target.id: _text(statement.value, target.id, name)
        for statement in statements
        if isinstance(statement, ast.Assign | ast.AnnAssign) and statement.value is not None
        for target in (statement.targets if isinstance(statement, ast.Assign) else [statement.target])
        if isinstance(target, ast.Name) and target.id in ("prompt", "completion")
    }
    if "completion" not in texts:
        raise UserError("does not assign a text to `completion`", file=name)
    return texts


def _text(written: ast.expr, what: str, name: str) -> str:
    match written:
        case ast.Constant(str(text)):
            # As JSON will hold it, in which both halves of a surrogate pair are one character.
            return text.encode("utf-16", errors="surrogatepass").decode("utf-16", errors="surrogatepass")
    sentence = f"`{what}` is not a plain string; write the text out"
    raise UserError(sentence, file=name, line=written.lineno)
