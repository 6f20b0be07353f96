"""`codebotler missions`: lists missions, shows one, writes one as MCAP."""

from __future__ import annotations

import os
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from codebotler.cli.views import list_view, mission_view
from codebotler.core.terminal import note, print_json, print_rich, visible
from codebotler.missions.log import events_of
from codebotler.missions.pictures import FOLDER, picture_of
from codebotler.missions.store import find, missions, recover, summary_of

if TYPE_CHECKING:
    from codebotler.missions.mcap import Clock


def show_missions(home: Path, *, json: bool) -> None:
    """Print all missions, the last one last."""
    note_interrupted(home)
    known = missions(home)
    if json:
        print_json([asdict(summary) for summary in known])
    else:
        print_rich(list_view(known))


def show_mission(home: Path, name: str, *, json: bool) -> None:
    """Print what happened in a mission; `last` names the last one."""
    note_interrupted(home)
    folder = find(home, name)
    summary, events = summary_of(folder), events_of(folder)
    if json:
        print_json({**asdict(summary), "events": events})
    else:
        print_rich(mission_view(summary, events))
        if any(picture_of(folder, line) for line in events):
            note(f"its pictures lie in {folder / FOLDER}")


def write_mission(home: Path, name: str, path: Path, *, clock: Clock) -> None:
    """Write a mission as an MCAP file."""
    from codebotler.missions.mcap import export

    note_interrupted(home)
    folder = find(home, name)
    summary, events = summary_of(folder), events_of(folder)
    export(path, summary, events, clock, folder)
    note(f"wrote {len(events):,} events of mission {summary.id} to {path}")


def note_interrupted(home: Path) -> None:
    """Close the missions that a dead tool left behind, and say so."""

    def unclosed(mission: str, error: OSError) -> None:
        where = f"{visible(os.fsdecode(error.filename))}: " if error.filename else ""
        note(f"mission {mission} may have been interrupted, but cannot be closed: {where}{error.strerror}")

    for summary in recover(home, unclosed):
        note(f"mission {summary.id} was interrupted: {visible(summary.reason)}")
