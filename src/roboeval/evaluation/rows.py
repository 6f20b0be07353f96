"""Rows of an evaluation as its file holds them: nothing unknown is in them; a finished file has a seal."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Iterator, Mapping
from operator import itemgetter
from pathlib import Path
from types import NoneType
from typing import Any, cast

from codebotler.badinput import BadInput
from codebotler.files import read_rows
from codebotler.skills import SKILLS
from codebotler.trace import Status
from roboeval.evaluation.completions import Row

MAX_EVALUATION = 1_000_000_000  # of a row that was written before rows were bounded
HASH_LINE = 65  # bytes: 64 hexadecimal digits and a line end
NO_ROW = "this line is no row of an evaluation"
STATUSES = frozenset(map(str, Status))
KINDS = frozenset(SKILLS.recordings)

Form = Mapping[str, tuple[type, ...]]
ROW: Form = {
    "task": (str,),
    "prompt": (int,),
    "index": (int,),
    "passed": (bool,),
    "failure": (dict, NoneType),
    "verdicts": (list,),
}
FAILURE: Form = {"class": (str,), "kind": (str,), "world": (int,), "check": (str, NoneType)}
VERDICT: Form = {
    "world": (str,),
    "satisfied": (bool,),
    "status": (str,),
    "error": (dict, NoneType),
    "line": (int, NoneType),
    "failed_checks": (list,),
    "trace": (list,),
}
ERROR: Form = {"kind": (str,), "message": (str,)}
VERDICT_CUT: Form = {**VERDICT, "cut": (dict,)}
CUT: Form = {"events": (int,), "sha256": (str,)}


class Seal:
    """How many rows a file holds, and the hash of its bytes: what KEY.json says of a finished evaluation."""

    def __init__(self) -> None:
        self._count, self._hash = 0, hashlib.sha256()

    def add(self, line: bytes) -> None:
        """Take a line of the file into account, whether it is read or written."""
        self._count += bool(line.strip())
        self._hash.update(line)

    @classmethod
    def of(cls, path: Path) -> Seal:
        """The seal of a file."""
        seal = cls()
        with path.open("rb") as file:
            for line in file:
                seal.add(line)
        return seal

    def data(self) -> dict[str, Any]:
        """As KEY.json writes it."""
        return {"rows": self._count, "sha256": self._hash.hexdigest()}

    def is_broken(self, head: Mapping[str, Any]) -> bool:
        """Whether these are other rows than when the evaluation was finished; never so before it is.

        Args:
            head: what KEY.json says.
        """
        return is_sealed(head) and any(head.get(name) != value for name, value in self.data().items())

    def check(self, head: Mapping[str, Any], path: Path) -> None:
        """Refuse other rows than those of the finished evaluation.

        Raises:
            BadInput: the file was damaged or changed.
        """
        if self.is_broken(head):
            raise BadInput(f"{BROKEN}; --redo starts over", file=path)


BROKEN = "was damaged or changed after the evaluation was finished"


def is_sealed(head: Mapping[str, Any]) -> bool:
    """Whether a KEY.json tells of a finished evaluation; one of an earlier version never does."""
    return "rows" in head or "sha256" in head


def row_of(data: object) -> Row:
    """The row of an evaluation that a line says.

    Raises:
        BadInput: it is none, or something in it is unknown.
    """
    row = _expect(data, ROW, "row")
    verdicts, why = row["verdicts"], row["failure"]
    for verdict in verdicts:
        _expect_verdict(verdict)
    if why is not None and not 0 <= _expect(why, FAILURE, "failure")["world"] < len(verdicts):
        raise BadInput(NO_ROW)
    if row["passed"] != (why is None):
        raise BadInput(NO_ROW)
    return cast("Row", row)


def _expect_verdict(data: object) -> None:
    is_cut = isinstance(data, dict) and "cut" in data
    verdict = _expect(data, VERDICT_CUT if is_cut else VERDICT, "verdict")
    if is_cut:
        _expect(verdict["cut"], CUT, "cut")
    if verdict["error"] is not None:
        _expect(verdict["error"], ERROR, "error")
    checks = verdict["failed_checks"]
    if verdict["status"] not in STATUSES or (checks and {*map(type, checks)} != {str}):
        raise BadInput(NO_ROW)
    try:
        unknown = {*map(itemgetter(0), verdict["trace"])}.difference(KINDS)
    except (TypeError, LookupError):
        raise BadInput(NO_ROW) from None
    if unknown:
        raise BadInput(f'{NO_ROW}: "{min(map(str, unknown))}" is no kind of event')


def _expect(data: object, form: Form, what: str) -> dict[str, Any]:
    if type(data) is not dict:
        raise BadInput(NO_ROW)
    if data.keys() != form.keys():
        unknown = sorted(data.keys() - form.keys())
        raise BadInput(f'{NO_ROW}: "{unknown[0]}" is no part of a {what}' if unknown else NO_ROW)
    for name, types in form.items():
        if type(data[name]) not in types:
            raise BadInput(NO_ROW)
    return data


def read_evaluations(
    path: Path, head: Mapping[str, Any], seal: Seal | None = None
) -> Iterator[tuple[int, Row]]:
    """Read the rows of an evaluation with the numbers of their lines.

    Args:
        path: the file of the rows.
        head: what KEY.json says.
        seal: takes the lines into account as they are read.

    Raises:
        BadInput: the file is missing, a line is no row of an evaluation, or, once all were read, they are
            others than those of the finished evaluation.
    """
    seal = seal or Seal()
    try:
        for number, row in read_rows(path, limit=MAX_EVALUATION, growing=True, see=seal.add):
            yield number, _at(path, number, row)
    except BadInput as error:
        if error.line is None:
            raise
        raise BadInput(f"{error.sentence}; --redo starts over", file=path, line=error.line) from None
    seal.check(head, path)


def _at(path: Path, number: int, data: object) -> Row:
    try:
        return row_of(data)
    except BadInput as error:
        raise BadInput(error.sentence, file=path, line=number) from None


def read_judged(
    rows: Path, programs: Path, head: Mapping[str, Any], seal: Seal | None = None
) -> Iterator[tuple[int, Row, str | None]]:
    """Read the rows of an evaluation with the numbers of their lines and the hashes of their programs.

    Args:
        rows: the file of the rows.
        programs: the file that holds, for each row in order, the hash of the program that it judges.
        head: what KEY.json says.
        seal: takes the lines of the rows into account as they are read.

    Raises:
        BadInput: as `read_evaluations` does.
    """
    hashes = programs.open("rb") if programs.exists() else io.BytesIO()
    with hashes:
        for number, row in read_evaluations(rows, head, seal):
            line = hashes.read(HASH_LINE)
            whole = len(line) == HASH_LINE
            yield number, row, line.decode(errors="replace").rstrip("\n") if whole else None
