"""`codebotler missions`: list missions, show one, or write one as an MCAP file."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from codebotler.cli.views import list_view, mission_view
from codebotler.core.terminal import note, print_json, print_rich
from codebotler.missions.storage.log import MissionSummary, read_events
from codebotler.missions.storage.pictures import PICTURE_FOLDER, read_picture
from codebotler.missions.storage.store import find_mission, find_rest, read_missions, recover_missions

if TYPE_CHECKING:
    from codebotler.missions.storage.mcap import TimeSource


def show_missions(home: Path, *, json: bool) -> None:
    """Print all missions, the most recent one last."""
    recover_missions(home)
    known = read_missions(home)
    if json:
        print_json([asdict(summary) for summary in known])
    else:
        print_rich(list_view(known))


def show_mission(home: Path, name: str, *, json: bool) -> None:
    """Print the events of a mission, or of the most recent one for the name `last`."""
    recover_missions(home)
    folder = find_mission(home, name)
    summary, events = MissionSummary.read(folder), read_events(folder)
    if json:
        print_json({**asdict(summary), "events": events})
    else:
        print_rich(mission_view(summary, events, find_rest(folder)))
        if any(read_picture(folder, line) for line in events):
            note(f"the pictures are in {folder / PICTURE_FOLDER}")


def write_mission(home: Path, name: str, path: Path, *, clock: TimeSource) -> None:
    """Write a mission as an MCAP file."""
    from codebotler.missions.storage.mcap import export_mcap

    recover_missions(home)
    folder = find_mission(home, name)
    summary, events = MissionSummary.read(folder), read_events(folder)
    export_mcap(path, summary, events, clock, folder)
    note(f"wrote {len(events):,} events of mission {summary.id} to {path}")
