"""Recorded models: programs that people wrote for known instructions; they need no key and no network."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from codebotler.badinput import BadInput, YamlFile

FOLDER = Path(__file__).with_name("recorded")
NAMES = ("careful", "hasty")


@dataclass(frozen=True)
class Reply:
    """One program that somebody wrote for an instruction.

    Args:
        about: what it does, or what is wrong with it, in a few words.
        program: its source.
        fails: the kind of its failure; None if it does what was asked.
    """

    about: str
    program: str
    fails: str | None = None


@dataclass(frozen=True)
class RecordedModel:
    """Replies by instruction.

    Args:
        name: `careful` or `hasty`.
        replies: for each instruction at least one.
    """

    name: str
    replies: Mapping[str, tuple[Reply, ...]]

    def reply(self, instruction: str, index: int) -> Reply:
        """The reply that stands for completion number `index`, counted from 0; they come round again.

        Raises:
            KeyError: nobody recorded this instruction.
        """
        replies = self.replies[instruction]
        return replies[index % len(replies)]


@cache
def recorded_model(name: str) -> RecordedModel:
    """Read a recorded model that ships with the package.

    Args:
        name: `recorded` (the careful one), `recorded:careful` or `recorded:hasty`.

    Raises:
        BadInput: there is no such model.
    """
    short = name.removeprefix("recorded").removeprefix(":") or NAMES[0]
    if short not in NAMES:
        known = ", ".join(f"recorded:{known}" for known in NAMES)
        raise BadInput(f'there is no recorded model "{name}"; there are {known}')
    replies: dict[str, tuple[Reply, ...]] = {}
    for path in sorted((FOLDER / short).glob("*.yaml")):
        replies.update(read_replies(path))
    return RecordedModel(short, replies)


def read_replies(path: Path) -> Mapping[str, tuple[Reply, ...]]:
    """Read a file of recorded replies.

    Raises:
        BadInput: it is missing or wrong.
    """
    file = YamlFile.read(path)
    if not isinstance(file.data, list):
        raise file.wrong("this is no list of instructions with their replies; start each with a dash")
    recordings = [file.validate(RecordingFile, item, at=(index,)) for index, item in enumerate(file.data)]
    return {
        recording.instruction: tuple(Reply(r.about, r.program, r.fails) for r in recording.replies)
        for recording in recordings
    }


class _Form(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ReplyFile(_Form):
    """A reply as the file writes it."""

    about: str
    fails: str | None = None
    program: str


class RecordingFile(_Form):
    """An instruction and its replies as the file writes them."""

    instruction: str
    replies: Annotated[list[ReplyFile], Field(min_length=1)]
