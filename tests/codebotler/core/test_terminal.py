"""No way of printing lets foreign text send control characters to the terminal."""

from __future__ import annotations

import ast
import io
import logging
import os
import re
import select
import sys
import threading
import warnings
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import pytest
import typer
from rich.text import Text

import codebotler
import roboeval
from codebotler.cli.app import app
from codebotler.cli.ending import run_command_line
from codebotler.core import terminal
from codebotler.core.errors import UserError
from codebotler.models.base import ModelError

HOSTILE_TEXT = "a\x1b]0;owned\x07\x1b[2J\x9b31m\u202eb\tc\x7f"
ESCAPED = ("a\\x1b]0;owned", "\\x1b[2J\\x9b31m\\u202eb")

LIBRARIES = {"click", "logging", "rich", "typer"}
PRINTS = {"print", "echo", "secho", "confirm", "prompt", "StreamHandler", "basicConfig"} | {
    "Console",
    "get_console",
    "Live",
    "Progress",
    "Prompt",
    "Status",
    "track",
}
STREAMS = {"stdout", "stderr", "__stdout__", "__stderr__"}
MAY_WRITE = re.compile(
    rf"\b(?:print|input)\(|^\s*(?:from|import) (?:{'|'.join(LIBRARIES)})\b|std(?:out|err)", re.MULTILINE
)
"""Every module that writes matches this; the other modules are not parsed."""
SOURCE = [Path(package.__file__ or "").parent for package in (codebotler, roboeval)]
WRITER = Path(terminal.__file__ or "")
CHILDREN = {"environment.py", "channel.py"}
"""Scripts that run in child processes, whose output the parent reads."""


def raise_in_command(error: Exception) -> None:
    commands = typer.Typer()

    @commands.command()
    def raise_error() -> None:
        raise error

    with pytest.raises(SystemExit):
        run_command_line(commands, "codebotler")


def print_while_busy(text: str) -> None:
    with terminal.busy(text):
        terminal.note(text)


def fail(text: str) -> None:
    raise ValueError(text)


def fail_in_a_thread(text: str) -> None:
    thread = threading.Thread(target=fail, args=(text,))
    thread.start()
    thread.join()


WAYS_TO_PRINT: dict[str, Callable[[str], object]] = {
    "a string": terminal.print_text,
    "a program": terminal.print_source,
    "a note": terminal.note,
    "a question": terminal.confirm,
    "a drawing": lambda text: terminal.print_rich(Text(text)),
    "a line": lambda text: terminal.console(highlight=False).print(text, markup=False),
    "what goes on": print_while_busy,
    "a refusal": lambda text: raise_in_command(UserError(text)),
    "a model's error": lambda text: raise_in_command(ModelError(text, is_temporary=False)),
    "a file's name": lambda text: raise_in_command(FileNotFoundError(2, "No such file", text)),
    "a log": lambda text: logging.getLogger("anybody").warning(text),
    "a warning": lambda text: warnings.warn(text, stacklevel=1),
    "a bug": fail,
    "a bug in a thread": fail_in_a_thread,
}


@pytest.mark.parametrize("is_terminal", [True, False])
@pytest.mark.parametrize("way", WAYS_TO_PRINT)
def test_foreign_text_cannot_control_the_terminal(
    way: str, *, is_terminal: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(logging.root, "handlers", [])
    monkeypatch.setattr(sys, "argv", ["codebotler"])
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "200")
    for stream in (sys.stdout, sys.stderr):
        monkeypatch.setattr(stream, "isatty", lambda: is_terminal)
    ends = pytest.raises(SystemExit) if way == "a bug" else nullcontext()
    with warnings.catch_warnings(), ends:
        warnings.simplefilter("always")
        with terminal.report_problems():
            WAYS_TO_PRINT[way](HOSTILE_TEXT)
    out = "".join(capsys.readouterr())
    if way == "a program" and not is_terminal:
        assert out == HOSTILE_TEXT + "\n"
        return
    assert all(piece in out for piece in ESCAPED)
    assert not any(obeyed in out for obeyed in ("\x07", "\x9b", "\u202e", "\x7f", "\x1b]", "\x1b[2J"))


def test_room_name_is_printed_without_control_characters(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    world, program = tmp_path / "world.yaml", tmp_path / "program.py"
    world.write_text('robot: "lob\\e]0;owned\\aby"\nrooms: [kitchen]\n')
    program.write_text('def task_program():\n    go_to("kitchen")\n')
    monkeypatch.setattr(sys, "argv", ["codebotler", "check", str(program), "--world", str(world)])
    with pytest.raises(SystemExit) as end:
        run_command_line(app, "codebotler")
    assert end.value.code == 2
    assert "lob\\x1b]0;owned\\x07by" in capsys.readouterr().err


def find_direct_writes(path: Path) -> list[str]:
    """List where a module prints, draws, or uses the standard output or error directly."""
    text = path.read_text()
    if not MAY_WRITE.search(text):
        return []
    tree = ast.parse(text)
    imported = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] in LIBRARIES
        for alias in node.names
    }
    found = []
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Name(id="print" | "input" as name)):
                pass
            case ast.Call(func=ast.Name(id=name)) if name in PRINTS & imported:
                pass
            case ast.Call(func=ast.Attribute(value=ast.Name(id=library), attr=name)) if (
                library in LIBRARIES and name in PRINTS
            ):
                pass
            case ast.Attribute(value=ast.Name(id="sys"), attr=name) if name in STREAMS:
                pass
            case ast.ImportFrom(module="sys", names=[*_, ast.alias(name=name)]) if name in STREAMS:
                pass
            case _:
                continue
        found.append(f"{path.name}, line {node.lineno}: {name}")
    return found


def test_only_one_module_writes_to_the_terminal() -> None:
    modules = [path for source in SOURCE for path in source.rglob("*.py")]
    ours = [path for path in modules if path != WRITER and path.name not in CHILDREN]
    assert len(ours) > 200
    assert [place for path in ours for place in find_direct_writes(path)] == []
    assert find_direct_writes(WRITER)


def test_input_typed_before_a_question_is_discarded(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, person = os.openpty()
    with os.fdopen(person) as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        os.write(ours, b"y\n")
        assert select.select([stdin], [], [], 10)[0], "the early answer did not arrive"
        timer = threading.Timer(0.05, os.write, (ours, b"no\n"))
        timer.start()
        assert terminal.read_line("Run it? ") == "no\n"
        timer.join()
    os.close(ours)


def test_a_text_is_not_cut_where_the_note_would_be_as_long() -> None:
    assert terminal.shortened("x" * 530) == "x" * 530
    assert terminal.shortened("x" * 531) == "x" * 500 + "... 31 more characters"
