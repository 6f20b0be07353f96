"""Recorded models: hand-written programs for known instructions, without a key or a network."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import SequenceMatcher
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from codebotler.core.errors import UserError
from codebotler.core.yaml_files import YamlFile
from codebotler.models.base import Heard, ModelError, Reply, Usage, unheard
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt

FOLDER = Path(__file__).with_name("recorded")
NAMES = ("careful", "hasty")
CLOSEST, SHOWN = 3, 100  # how many instructions are suggested, and how much of each, in characters
LONG = re.compile(r"[^\W\d_]{4,}")  # shorter words are in every instruction
NOTICE = "recorded programs, no language model; choose one with --model (`codebotler models` lists them)"


class Solution(BaseModel):
    """A hand-written program for an instruction, right or wrong on purpose."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    about: str  # what is special about it, or wrong with it, in a few words
    program: str
    fails: str | None = None  # the kind of its failure; None if it passes
    right: bool = False  # whether it does what was asked although it fails: the checks are too strict for it


class InstructionSolutions(BaseModel):
    """The replies of the recorded models to one instruction."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    instruction: str
    careful: Annotated[tuple[Solution, ...], Field(min_length=1)]
    hasty: Annotated[tuple[Solution, ...], Field(min_length=1)]

    def by(self, model: str) -> tuple[Solution, ...]:
        """The replies of one of the models."""
        return self.careful if model == "careful" else self.hasty


class RecordedFile(BaseModel):
    """The part of a file of solutions that the recorded models need; the benchmark reads the rest."""

    recorded: tuple[InstructionSolutions, ...] = ()


class UnknownInstructionError(ModelError):
    """A recorded model does not know an instruction.

    Args:
        model: its name.
        instruction: what it was asked for.
        closest: the instructions that it knows and that are most alike.
    """

    def __init__(self, model: str, instruction: str, closest: Sequence[str]) -> None:
        alike = " or ".join(f'"{_short(known)}"' for known in closest)
        super().__init__(
            f'{model} has no program for "{_short(instruction)}"; the closest that it knows: {alike}',
            may_pass=False,
        )
        self.model, self.instruction, self.closest = model, instruction, tuple(closest)

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.model, self.instruction, self.closest)


@dataclass(frozen=True)
class RecordedModel:
    """A model that knows a few instructions by heart."""

    name: str  # such as `recorded:careful`
    replies: Mapping[str, tuple[Solution, ...]] = field(repr=False)  # by instruction, at least one each
    offered: tuple[str, ...] = field(default=(), repr=False)  # instructions that make sense by themselves
    settings: SamplingSettings = field(default_factory=partial(SamplingSettings, None, None))

    def solution(self, instruction: str, index: int) -> Solution:
        """The reply for completion number `index`, counted from 0; they come round again."""
        replies = self.replies[instruction]
        return replies[index % len(replies)]

    async def reply(self, prompt: Prompt, *, number: int, heard: Heard = unheard) -> Reply:
        """The recorded reply; it takes no time and no tokens."""
        known = {_words(instruction): instruction for instruction in self.replies}
        instruction = known.get(_words(prompt.instruction))
        if instruction is None:
            raise UnknownInstructionError(
                self.name, prompt.instruction, closest_to(prompt.instruction, self.offered)
            )
        program = self.solution(instruction, number).program
        heard(program)
        return Reply(program, program, Usage(), 0.0, "stop")

    async def close(self) -> None:
        """Nothing to close."""


def closest_to(instruction: str, known: Iterable[str]) -> list[str]:
    """The known instructions that share most long words, in the same order, with an unknown one."""
    matcher = SequenceMatcher(a=(), b=LONG.findall(instruction.lower()), autojunk=False)

    def likeness(other: str) -> tuple[int, float]:
        matcher.set_seq1(LONG.findall(other.lower()))
        return sum(block.size for block in matcher.get_matching_blocks()), matcher.ratio()

    return sorted(known, key=likeness, reverse=True)[:CLOSEST]


def _words(text: str) -> tuple[str, ...]:
    return tuple(text.lower().rstrip(". \n").split())


def _short(text: str) -> str:
    return textwrap.shorten(text, SHOWN, placeholder=" ...")


def is_recorded(name: str) -> bool:
    """Whether a name is that of a recorded model."""
    return name.partition(":")[0] == "recorded"


def recorded_model(name: str, folder: Path | None = None) -> RecordedModel:
    """A recorded model by its name; `recorded` means `recorded:careful`, `recorded:FOLDER` your own files.

    Args:
        name: of the model.
        folder: of further files that it knows.
    """
    short = name.removeprefix("recorded").removeprefix(":") or NAMES[0]
    if short not in NAMES and Path(short).is_dir():
        own = _read(Path(short))
        replies = {one.instruction: one.careful for one in own}
        return RecordedModel(f"recorded:{short}", replies, tuple(replies))
    if short not in NAMES:
        known = ", ".join(f"recorded:{known}" for known in NAMES)
        raise UserError(f'there is no recorded model "{name}"; there are {known}')
    usual, of_rules = (_recorded(suite) for suite in ("paper", "rules"))
    further = () if folder is None else _read(folder)
    replies = {one.instruction: one.by(short) for one in (*usual, *of_rules, *further)}
    return RecordedModel(f"recorded:{short}", replies, tuple(one.instruction for one in usual))


@cache
def _recorded(suite: str) -> tuple[InstructionSolutions, ...]:
    """The instructions of a suite of the benchmark; with those of the paper's, our own."""
    return _read(*_folders(suite), *([FOLDER] if suite == "paper" else []))


def _read(*folders: Path) -> tuple[InstructionSolutions, ...]:
    files = sorted((f for folder in folders for f in folder.glob("*.yaml")), key=lambda file: file.name)
    forms = (YamlFile.read(file).validate(RecordedFile) for file in files)
    return tuple(one for form in forms for one in form.recorded)


def _folders(suite: str) -> Iterator[Path]:
    # The benchmark's solutions are data of roboeval, whose code codebotler must not import.
    benchmark = find_spec("roboeval")
    for place in (benchmark and benchmark.submodule_search_locations) or ():
        yield Path(place, "suites", suite, "solutions")
