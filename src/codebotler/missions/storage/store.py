"""List and find past missions on disk, and close interrupted missions."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Mapping, Sequence
from contextlib import closing, suppress
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.core.skills.values import written_call
from codebotler.core.terminal import note, system_sentence, visible
from codebotler.missions.storage.log import (
    SUMMARY_FILE,
    LogLine,
    MissionState,
    MissionSummary,
    add_event,
    find_unfinished_skill,
    open_log,
    read_events,
)

RECENT_MISSIONS = 200
"""How many of the latest missions to read, to list them for agents or to find the last one."""

_MISSION_ID = re.compile(r"\d{8}-\d{6}(-\d{1,6})?", re.ASCII)


def read_missions(home: Path, most: int | None = None) -> list[MissionSummary]:
    """Read all or the last `most` mission summaries, oldest first. Raise UserError if one is damaged."""
    folders = _mission_folders(home)[-most if most else 0 :]
    return sorted(map(MissionSummary.read, folders), key=lambda summary: (summary.created, summary.id))


def find_mission(home: Path, name: str) -> Path:
    """Return the folder of a mission, given its ID or `last`. Raise UserError if there is no such mission."""
    if name == "last" and (known := read_missions(home, RECENT_MISSIONS)):
        return home / "missions" / known[-1].id
    folder = home / "missions" / name
    if not _MISSION_ID.fullmatch(name) or not (folder / SUMMARY_FILE).is_file():
        raise UserError(f'there is no mission "{name}"; `codebotler missions` lists them')
    return folder


def find_rest(folder: Path) -> MissionSummary | None:
    """Return the last mission in the chain that continued the one in `folder`, or None. Skip damaged ones."""
    known: list[MissionSummary] = []
    for path in sorted(folder.parent.glob(f"*/{SUMMARY_FILE}")):
        with suppress(UserError, OSError):
            known.append(MissionSummary.read(path.parent))
    return last_rest(folder.name, rests_in(known))


def rests_in(known: Sequence[MissionSummary]) -> dict[str, MissionSummary]:
    """Map the ID of each mission to the mission that continued it. Skip continuations that never ran."""
    return {one.continues: one for one in known if one.if_tool_dies and one.continues}


def last_rest(mission: str, rests: Mapping[str, MissionSummary]) -> MissionSummary | None:
    """Return the last mission in the chain that continues `mission`, or None. `rests` is from `rests_in`."""
    rest, seen = rests.get(mission), {mission}  # IDs are local times, which tell no order
    while rest is not None and rest.id in rests and rest.id not in seen:
        seen.add(rest.id)
        rest = rests[rest.id]
    return rest


def rest_text(rest: MissionSummary | None) -> str:
    """Return words such as `continued by mission 20260102-120000 (done)`, or "" if `rest` is None."""
    return "" if rest is None else f"continued by mission {rest.id} ({rest.state})"


def recover_missions(home: Path) -> list[MissionSummary]:
    """Mark missions whose process has ended as interrupted, report them on stderr, and return them."""
    found: list[MissionSummary] = []
    for folder in _mission_folders(home):
        try:
            found += _close_interrupted(folder)
        except UserError:
            continue
        except OSError as error:  # such as a full disk, which must not keep CodeBotler from starting
            why = system_sentence(error)
            note(f"mission {folder.name} may have been interrupted, but cannot be closed: {why}")
    for summary in found:
        note(f"mission {summary.id} was interrupted: {visible(summary.reason)}")
    return found


def find_interrupted(home: Path) -> list[MissionSummary]:
    """Return what `recover_missions` returns and, if it was interrupted, the last mission that ran."""
    found = recover_missions(home)
    with suppress(UserError):
        ran = [one for one in read_missions(home, RECENT_MISSIONS) if one.if_tool_dies]
        found += [one for one in ran[-1:] if one.state is MissionState.INTERRUPTED and one not in found]
    return found


def _mission_folders(home: Path) -> list[Path]:
    folder = home / "missions"
    try:
        found = sorted(folder.iterdir(), key=_numbers)
    except FileNotFoundError:
        return []
    except NotADirectoryError:
        sentence = "this is a file, not a folder of missions; set CODEBOTLER_HOME to another folder"
        raise UserError(sentence, file=folder) from None
    return [path for path in found if os.path.exists(path / SUMMARY_FILE)]  # noqa: PTH110 - raises nothing


def _numbers(folder: Path) -> tuple[list[int], str]:
    """Return a key that sorts the tenth mission of a second after the second one."""
    return [int(number) for number in re.findall(r"\d+", folder.name)], folder.name


def _close_interrupted(folder: Path) -> list[MissionSummary]:
    if MissionSummary.read(folder).has_ended:
        return []
    try:
        log = open_log(folder)
    except BlockingIOError:
        return []  # another process runs the mission
    with closing(log):
        summary, events = MissionSummary.read(folder), read_events(folder)
        if summary.has_ended:
            return []
        last = next((line for line in reversed(events) if line["event"] == "state"), None)
        if last is not None and MissionState(last["state"]).is_final:
            summary.state, summary.reason = MissionState(last["state"]), last.get("reason", "")
            summary.ended = last["time"]
            summary.write(folder)
            return []
        summary.reason, clock = _interruption_reason(summary, events), events[-1]["clock"] if events else 0.0
        summary.state, summary.ended = MissionState.INTERRUPTED, time.time()
        add_event(log, "state", clock, state=summary.state, reason=summary.reason)
        summary.write(folder)
        return [summary]


def _interruption_reason(summary: MissionSummary, events: list[LogLine]) -> str:
    if not summary.state.is_moving:
        return "CodeBotler ended unexpectedly before the program ran"
    skill = find_unfinished_skill(events)
    if skill is None:
        return "CodeBotler ended unexpectedly while the robot was idle"
    going = written_call(skill["skill"], list(skill["arguments"].values()))
    where = next((f", {e['text']}" for e in reversed(events) if e["event"] == "feedback"), "")
    return f"CodeBotler ended unexpectedly during {going}{where}; {summary.if_tool_dies}"
