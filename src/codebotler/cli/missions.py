"""`codebotler missions`: list missions, show one, write one as MCAP."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from codebotler.cli.views import list_view, mission_view
from codebotler.core.terminal import note, print_json, print_rich
from codebotler.missions.log import Summary, events_of
from codebotler.missions.pictures import FOLDER, picture_of
from codebotler.missions.store import find, missions, recover

if TYPE_CHECKING:
    from codebotler.missions.mcap import Clock


def show_missions(home: Path, *, json: bool) -> None:
    """Print all missions, the last one last."""
    recover(home)
    known = missions(home)
    if json:
        print_json([asdict(summary) for summary in known])
    else:
        print_rich(list_view(known))


def show_mission(home: Path, name: str, *, json: bool) -> None:
    """Print the events of a mission; `last` names the last one."""
    recover(home)
    folder = find(home, name)
    summary, events = Summary.read(folder), events_of(folder)
    if json:
        print_json({**asdict(summary), "events": events})
    else:
        print_rich(mission_view(summary, events))
        if any(picture_of(folder, line) for line in events):
            note(f"its pictures are in {folder / FOLDER}")


def write_mission(home: Path, name: str, path: Path, *, clock: Clock) -> None:
    """Write a mission as an MCAP file."""
    from codebotler.missions.mcap import export

    recover(home)
    folder = find(home, name)
    summary, events = Summary.read(folder), events_of(folder)
    export(path, summary, events, clock, folder)
    note(f"wrote {len(events):,} events of mission {summary.id} to {path}")
