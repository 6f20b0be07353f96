"""A step of a trace as a line of text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from codebotler.storyboard import DID
from codebotler.terminal import shortened

MOST_OPTIONS = 20


def told_step(step: Mapping[str, Any]) -> str:
    """A step: its number, the room, and what the robot did there.

    Args:
        step: as `steps_of` gives it.
    """
    place = f"{shortened(step['place'], 200)}: " if "place" in step else ""
    return f"{step['step']:>4}  {place}{_deed(step)}"


def _deed(step: Mapping[str, Any]) -> str:
    text = f'"{shortened(step["text"])}"'
    match step["kind"]:
        case "goto":
            to = step.get("to", step["text"])
            found = "there is no such room" if to is None else shortened(to, 200)
            return f"drives to {text}" if to == step["text"] else f"drives to {text}: {found}"
        case "check":
            return f"looks for {text}: {'found' if step.get('found') else 'not found'}"
        case "ask":
            answer = "no answer" if step["answer"] is None else f'"{shortened(step["answer"])}"'
            return f"asks {text} [{_options(step['options'])}]: {answer}"
        case kind:
            return f"{DID.get(kind) or shortened(kind)} {text}"


def _options(options: list[str | Mapping[str, str]]) -> str:
    shown = [shortened(o) if isinstance(o, str) else f"{shortened(o['no text'])} (no text)" for o in options]
    left = len(shown) - MOST_OPTIONS
    return " | ".join(shown[:MOST_OPTIONS] + [f"{left:,} more"] * (left > 0))
