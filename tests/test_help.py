"""`--help` is readable on a narrow terminal."""

import os
import re
import subprocess
import sys

import pytest

NARROW = 80
"""Columns of a terminal by default."""


@pytest.mark.parametrize(
    ("name", "least"),
    [("codebotler", 7), ("roboeval", 14)],
)
def test_help_describes_every_command_in_a_whole_sentence(name: str, least: int) -> None:
    code = f"import sys; from {name}.__main__ import main; sys.argv = ['{name}', '--help']; main()"
    ended = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "COLUMNS": str(NARROW)},
        capture_output=True,
        text=True,
        check=True,
    )
    _, _, listed = ended.stdout.partition("\nCommands:\n")
    sentences = dict(re.findall(r"^  (\S+) +(.*)$", listed, re.MULTILINE))
    assert len(sentences) >= least, ended.stdout
    assert [command for command, sentence in sentences.items() if not re.search(r"[^.]\.$", sentence)] == []
    assert all(len(line) <= NARROW for line in ended.stdout.splitlines())
