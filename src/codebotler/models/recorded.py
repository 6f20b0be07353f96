"""Recorded models: programs that people wrote for known instructions; they need no key and no network."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from difflib import SequenceMatcher
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from codebotler.core.cachedproperty import cached_property
from codebotler.core.errors import UserError
from codebotler.core.yaml_files import YamlFile
from codebotler.models import base
from codebotler.models.base import Heard, ModelError, Usage, unheard
from codebotler.prompts import Prompt

FOLDER = Path(__file__).with_name("recorded")
NAMES = ("careful", "hasty")
CLOSEST, SHOWN = 3, 100  # how many instructions are suggested, and how much of each, in characters
LONG = re.compile(r"[^\W\d_]{4,}")  # shorter words are in every instruction
REAL_MODEL = "name a real model to have a program written for it, such as --model openai-chat:gpt-5.1"


class Solution(BaseModel):
    """A program that a person wrote for an instruction, right or wrong on purpose.

    Args:
        about: what is special about it, or what is wrong with it, in a few words.
        program: its source.
        fails: the kind of its failure; None if it passes.
        right: whether it does what was asked although it fails: the checks are too strict for it.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    about: str
    program: str
    fails: str | None = None
    right: bool = False


class Recording(BaseModel):
    """What the recorded models reply to an instruction."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    instruction: str
    careful: Annotated[tuple[Solution, ...], Field(min_length=1)]
    hasty: Annotated[tuple[Solution, ...], Field(min_length=1)]

    def by(self, model: str) -> tuple[Solution, ...]:
        """The replies of one of the models."""
        return self.careful if model == "careful" else self.hasty


class RecordedFile(BaseModel):
    """What a file of solutions holds for the recorded models; the rest of it is for the benchmark."""

    recorded: tuple[Recording, ...]


@dataclass(frozen=True)
class RecordedReplies:
    """Replies by instruction.

    Args:
        name: `careful` or `hasty`.
        replies: for each instruction at least one.
    """

    name: str
    replies: Mapping[str, tuple[Solution, ...]]

    def reply(self, instruction: str, index: int) -> Solution:
        """The reply that stands for completion number `index`, counted from 0; they come round again.

        Raises:
            KeyError: nobody recorded this instruction.
        """
        replies = self.replies[instruction]
        return replies[index % len(replies)]


@dataclass(frozen=True)
class RecordedModel:
    """A recorded model that is asked like any other.

    Args:
        recorded: what it recites.
    """

    recorded: RecordedReplies

    @property
    def name(self) -> str:
        """Such as `recorded:careful`."""
        return f"recorded:{self.recorded.name}"

    async def reply(self, prompt: Prompt, *, number: int, heard: Heard = unheard) -> base.Reply:
        """The recorded reply that stands for completion number `number`; it takes no time and no tokens.

        Raises:
            ModelError: nobody recorded the instruction; the sentence names the closest that were.
        """
        instruction = self._known.get(_words(prompt.instruction))
        if instruction is None:
            raise ModelError(self._unknown(prompt.instruction), may_pass=False)
        program = self.recorded.reply(instruction, number).program
        heard(program)
        return base.Reply(program, program, Usage(), 0.0, "stop")

    async def close(self) -> None:
        """Nothing is held."""

    @cached_property
    def _known(self) -> Mapping[tuple[str, ...], str]:
        return {_words(instruction): instruction for instruction in self.recorded.replies}

    def _unknown(self, instruction: str) -> str:
        closest = " or ".join(
            f'"{_short(known)}"' for known in closest_to(instruction, self.recorded.replies)
        )
        return (
            f'{self.name} has no program for "{_short(instruction)}"; '
            f"the closest instructions it knows are {closest}; {REAL_MODEL}"
        )


def closest_to(instruction: str, known: Iterable[str]) -> list[str]:
    """The known instructions that share most long words, in the same order, with one that is not known."""
    matcher = SequenceMatcher(a=(), b=LONG.findall(instruction.lower()), autojunk=False)

    def likeness(other: str) -> tuple[int, float]:
        matcher.set_seq1(LONG.findall(other.lower()))
        return sum(block.size for block in matcher.get_matching_blocks()), matcher.ratio()

    return sorted(known, key=likeness, reverse=True)[:CLOSEST]


def _words(text: str) -> tuple[str, ...]:
    return tuple(text.lower().rstrip(". \n").split())


def _short(text: str) -> str:
    return textwrap.shorten(text, SHOWN, placeholder=" ...")


def recorded_model(name: str) -> RecordedReplies:
    """A recorded model by its name.

    Args:
        name: `recorded` (the careful one), `recorded:careful` or `recorded:hasty`.

    Raises:
        UserError: there is no such model.
    """
    short = name.removeprefix("recorded").removeprefix(":") or NAMES[0]
    if short not in NAMES:
        known = ", ".join(f"recorded:{known}" for known in NAMES)
        raise UserError(f'there is no recorded model "{name}"; there are {known}')
    return RecordedReplies(short, {one.instruction: one.by(short) for one in _recordings()})


@cache
def _recordings() -> tuple[Recording, ...]:
    files = sorted(
        (file for folder in _folders() for file in folder.glob("*.yaml")), key=lambda file: file.name
    )
    forms = (YamlFile.read(file).validate(RecordedFile) for file in files)
    return tuple(recording for form in forms for recording in form.recorded)


def _folders() -> Iterator[Path]:
    """Where solutions lie: here, and among the benchmark's tasks, none of whose code is imported."""
    yield FOLDER
    benchmark = find_spec("roboeval")
    for place in (benchmark and benchmark.submodule_search_locations) or ():
        yield Path(place, "suites", "paper", "solutions")
