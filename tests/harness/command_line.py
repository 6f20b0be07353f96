"""The two command lines as tests call them: in this process, or in one of their own where that matters."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Self

import pytest

from codebotler.cli.app import main as codebotler_main
from forked import Forked
from roboeval.cli.app import main as roboeval_main

MAINS = {"codebotler": codebotler_main, "roboeval": roboeval_main}
ENVIRONMENT = {**os.environ, "COLUMNS": "100", "NO_COLOR": "1"}
PROGRESS = re.compile(r"^(?:[a-z]+: [\d,]+( of [\d,]+)?(, .*)?|[\w .:-]+ \.\.\.)\n", re.MULTILINE)
PLACE = re.compile(r"(?P<of>[^:]+), line (?P<line>\d+): |(?P<file>[^\s:]+): ")


class Ended(NamedTuple):
    """How a command ended."""

    status: int
    out: str
    err: str


@dataclass(frozen=True)
class Refusal:
    """What a command says of what it cannot use: a sentence, behind the file and line it is about."""

    sentence: str
    file: str | None = None
    line: int | None = None

    @classmethod
    def parsed(cls, text: str) -> Self:
        """Of a string such as `a.jsonl, line 2: this line is not JSON`."""
        if not (found := PLACE.match(text)):
            return cls(text)
        return cls(text[found.end() :], found["of"] or found["file"], int(found["line"] or 0) or None)

    @property
    def at(self) -> tuple[str | None, int | None]:
        """The file and the line."""
        return self.file, self.line

    @property
    def commands(self) -> list[str]:
        """What it names in backquotes."""
        return re.findall("`([^`]+)`", self.sentence)


def roboeval(
    *arguments: str | Path,
    cwd: Path | None = None,
    before: str = "",
    after: str = "",
    environment: Mapping[str, str] | None = None,
) -> Ended:
    """Call a command of RoboEval; in a process of its own if something of bash stands before or after it."""
    if before or after:
        variables = environment or ENVIRONMENT
        return process("roboeval", *arguments, cwd=cwd, before=before, after=after, environment=variables)
    return command("roboeval", *arguments, cwd=cwd, environment=environment)


def refused(
    *arguments: str | Path, name: str = "roboeval", cwd: Path | None = None, given: str = "", lines: int = 1
) -> Refusal:
    """The one sentence with which a command refuses, or its few lines; nothing but it is printed."""
    ended = command(name, *arguments, cwd=cwd, given=given)
    assert ended.status == 2, ended
    assert ended.out == ""
    assert ended.err.startswith(f"{name}: ")
    assert ended.err.count("\n") == lines
    return Refusal.parsed(ended.err.removeprefix(f"{name}: ").rstrip("\n"))


def command(
    name: str,
    *arguments: str | Path,
    cwd: Path | None = None,
    given: str = "",
    environment: Mapping[str, str] | None = None,
) -> Ended:
    """Call a command in this process, which takes a fraction of what it takes to start one.

    Args:
        name: `codebotler` or `roboeval`.
        arguments: those of the command.
        cwd: the folder in which it is called.
        given: its standard input.
        environment: all its variables; those of this process by default, in a terminal of 100 columns.

    Returns:
        its end, without the lines that tell how far it has come, which only a slow machine prints.
    """
    variables = {**os.environ, "COLUMNS": "100", "NO_COLOR": "1"} if environment is None else environment
    with _streams(given) as (out, err), _place(cwd, variables), _arguments([name, *map(str, arguments)]):
        status = _status(MAINS[name])
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        texts = [_text(file) for file in (out, err)]
    return Ended(status, texts[0], PROGRESS.sub("", texts[1]))


def forked(name: str, *arguments: str | Path, cwd: Path | None = None) -> Ended:
    """Run a command or a script in a process of its own, forked from one that has imported what most need."""
    running = Forked(name, *arguments, cwd=cwd or Path.cwd(), environment=ENVIRONMENT)
    out, err = running.communicate()
    return Ended(running.wait(), out, PROGRESS.sub("", err))


def process(
    name: str,
    *arguments: str | Path,
    cwd: Path | None = None,
    before: str = "",
    after: str = "",
    environment: Mapping[str, str] = ENVIRONMENT,
) -> Ended:
    """Run a command in a process of its own, with something of bash before and after it."""
    words = shlex.join([sys.executable, "-m", name, *map(str, arguments)])
    ended = subprocess.run(
        ["bash", "-c", f"{before} {words} {after}"],
        capture_output=True,
        text=True,
        check=False,
        cwd=cwd,
        env=dict(environment),
    )
    return Ended(ended.returncode, ended.stdout, PROGRESS.sub("", ended.stderr))


def _status(main: Callable[[], object]) -> int:
    with pytest.raises(SystemExit) as end:
        main()
    assert isinstance(end.value.code, int)
    return end.value.code


@contextmanager
def _streams(given: str) -> Iterator[tuple[Path, Path]]:
    """Let the standard streams be files, which have numbers as a shell's have."""
    before = sys.stdin, sys.stdout, sys.stderr
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder, name) for name in ("in", "out", "err")]
        paths[0].write_text(given, encoding="utf-8")
        with (
            paths[0].open(encoding="utf-8") as stdin,
            paths[1].open("w", encoding="utf-8") as stdout,
            paths[2].open("w", encoding="utf-8", errors="backslashreplace", buffering=1) as stderr,
        ):
            sys.stdin, sys.stdout, sys.stderr = stdin, stdout, stderr
            try:
                yield paths[1], paths[2]
            finally:
                sys.stdin, sys.stdout, sys.stderr = before


@contextmanager
def _place(cwd: Path | None, environment: Mapping[str, str]) -> Iterator[None]:
    folder, variables = Path.cwd(), dict(os.environ)
    os.chdir(cwd or folder)
    os.environ.clear()
    os.environ.update(environment)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(variables)
        os.chdir(folder)


@contextmanager
def _arguments(words: list[str]) -> Iterator[None]:
    before, sys.argv = sys.argv, words
    try:
        yield
    finally:
        sys.argv = before


def _text(path: Path) -> str:
    return path.read_bytes().decode()
