"""The command line as tests call it: as a person would, in a process of its own."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple


class Ended(NamedTuple):
    """How a command ended."""

    status: int
    out: str
    err: str


ENVIRONMENT = {**os.environ, "COLUMNS": "100", "NO_COLOR": "1"}


def roboeval(
    *arguments: str | Path,
    cwd: Path | None = None,
    before: str = "",
    after: str = "",
    environment: Mapping[str, str] = ENVIRONMENT,
) -> Ended:
    """Run a command, with something of bash before and after it.

    How far it has come, which it tells after a while on a slow machine, is left out.
    """
    words = [sys.executable, "-m", "roboeval.cli", *map(str, arguments)]
    ended = subprocess.run(
        ["bash", "-c", f"{before} {shlex.join(words)} {after}"],
        capture_output=True,
        text=True,
        check=False,
        cwd=cwd,
        env=dict(environment),
    )
    how_far = r"^(?:[a-z]+: [\d,]+( of [\d,]+)?(, .*)?|[\w ]+ \.\.\.)\n"
    err = re.sub(how_far, "", ended.stderr, flags=re.MULTILINE)
    return Ended(ended.returncode, ended.stdout, err)


def refused(*arguments: str | Path, cwd: Path | None = None) -> str:
    """The one sentence with which a command refuses; nothing but it is printed."""
    ended = roboeval(*arguments, cwd=cwd)
    assert ended.status == 2, ended
    assert ended.out == ""
    assert ended.err.startswith("roboeval: ")
    assert ended.err.count("\n") == 1
    return ended.err.removeprefix("roboeval: ").rstrip("\n")
