"""Start `roboeval serve` for tests."""

from __future__ import annotations

from pathlib import Path

from pageserver import PageServer


def serve_runs(runs: Path, *arguments: str | Path) -> PageServer:
    """Serve the pages of a folder of runs in a process of their own.

    Args:
        runs: the folder.
        arguments: further arguments of the command.
    """
    home = runs.with_name(f"{runs.name}-served")
    home.mkdir()
    return PageServer(home, *map(str, arguments), serve=("roboeval", "serve", str(runs)))
