"""`roboeval serve` as a user starts it."""

from __future__ import annotations

from pathlib import Path

from pageserver import PageServer


def serving(runs: Path, *arguments: str | Path) -> PageServer:
    """The pages of a folder of runs, in a process of their own.

    Args:
        runs: the folder.
        arguments: further ones.
    """
    home = runs.with_name(f"{runs.name}-served")
    home.mkdir()
    return PageServer(home, *map(str, arguments), serve=("roboeval", "serve", str(runs)))
