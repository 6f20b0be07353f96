"""What `codebotler missions` does: lists missions, shows one, writes one for other tools."""

from __future__ import annotations

import os
from dataclasses import asdict
from pathlib import Path

from codebotler.cli.views import list_view, mission_view
from codebotler.core.terminal import note, print_json, print_rich, visible
from codebotler.missions.log import events_of
from codebotler.missions.mcap import Clock, export
from codebotler.missions.pictures import FOLDER, picture_of
from codebotler.missions.store import find, missions, recover, summary_of


def show_missions(home: Path, *, json: bool) -> None:
    """Print all missions, the last one last.

    Args:
        home: the folder of missions.
        json: whether for machines.

    Raises:
        UserError: one cannot be read.
    """
    note_interrupted(home)
    known = missions(home)
    if json:
        print_json([asdict(summary) for summary in known])
    else:
        print_rich(list_view(known))


def show_mission(home: Path, name: str, *, json: bool) -> None:
    """Print what happened in a mission.

    Args:
        home: the folder of missions.
        name: its name, or `last`.
        json: whether for machines.

    Raises:
        UserError: there is none of that name, or it cannot be read.
    """
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
    """Write a mission as an MCAP file.

    Args:
        home: the folder of missions.
        name: its name, or `last`.
        path: the file.
        clock: by which its messages are timed.

    Raises:
        UserError: there is none of that name, or it cannot be read.
        OSError: the file cannot be written.
    """
    note_interrupted(home)
    folder = find(home, name)
    summary, events = summary_of(folder), events_of(folder)
    export(path, summary, events, clock, folder)
    note(f"wrote {len(events):,} events of mission {summary.id} to {path}")


def note_interrupted(home: Path) -> None:
    """Close the missions that a tool left behind when it died, and say so.

    Raises:
        UserError: the folder of missions is none.
        OSError: that folder cannot be read.
    """

    def unclosed(mission: str, error: OSError) -> None:
        where = f"{visible(os.fsdecode(error.filename))}: " if error.filename else ""
        note(f"mission {mission} may have been interrupted, but cannot be closed: {where}{error.strerror}")

    for summary in recover(home, unclosed):
        note(f"mission {summary.id} was interrupted: {visible(summary.reason)}")
