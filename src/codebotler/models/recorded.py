"""Recorded models answer known instructions with hand-written programs, without a key or network."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from codebotler.core.errors import UserError
from codebotler.core.text.words import brief
from codebotler.core.yaml_files import YamlFile
from codebotler.models.base import ModelError, Reply, TextListener, Usage, ignore_text
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import NO_STEP, Prompt

RECORDED_FOLDER = Path(__file__).with_name("recorded")
RECORDED_NAMES = ("careful", "hasty")
MAX_SUGGESTIONS = 3
MAX_SHOWN_CHARACTERS = 100  # the maximum length of an instruction quoted in a message
LONG_WORD = re.compile(r"[^\W\d_]{4,}")  # shorter words occur in every instruction
RECORDED_NOTICE = (
    "recorded programs, no language model; choose one with --model (`codebotler models` lists them)"
)


class _RecordedPart(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Solution(_RecordedPart):
    """A hand-written program for an instruction, deliberately right or wrong."""

    about: str  # its special feature or its mistake, in a few words
    program: str
    fails: str | None = None  # the kind of failure; None if it passes
    right: bool = False  # whether it is correct although it fails because the checks are too strict


class Continuation(_RecordedPart):
    """A hand-written program for the rest of a mission that ended early, deliberately right or wrong."""

    about: str  # its special feature or its mistake, in a few words
    after: tuple[str, ...]  # the last step before the mission ended, in words; each of these fits
    program: str
    right: bool  # whether it is a reply of the careful model, not of the hasty one


class InstructionSolutions(_RecordedPart):
    """An instruction with the programs of both recorded models, and programs that continue its mission."""

    instruction: str
    careful: Annotated[tuple[Solution, ...], Field(min_length=1)]
    hasty: Annotated[tuple[Solution, ...], Field(min_length=1)]
    continuations: tuple[Continuation, ...] = ()

    def replies_of(self, model: str) -> tuple[Solution, ...]:
        """Return the replies of the recorded model `careful` or `hasty`."""
        return self.careful if model == "careful" else self.hasty


class RecordedFile(BaseModel):
    """The part of a solutions file that the recorded models need. The benchmark reads the other parts."""

    recorded: tuple[InstructionSolutions, ...] = ()


class UnknownInstructionError(ModelError):
    """Raised if a recorded model has no program for an instruction. The message suggests similar ones."""

    def __init__(self, model: str, instruction: str, closest: Sequence[str]) -> None:
        short = partial(brief, most=MAX_SHOWN_CHARACTERS)
        similar = " or ".join(f'"{short(known)}"' for known in closest)
        sentence = f'{model} has no program for "{short(instruction)}"; try {similar}'
        super().__init__(sentence, is_temporary=False)
        self.model, self.instruction, self.closest = model, instruction, tuple(closest)

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.model, self.instruction, self.closest)


@dataclass(frozen=True)
class RecordedModel:
    """A model that answers known instructions with recorded programs."""

    name: str  # such as `recorded:careful`
    replies: Mapping[str, tuple[Solution, ...]] = field(repr=False)  # by instruction, at least one for each
    rests: Mapping[tuple[str, str], str] = field(default_factory=dict, repr=False)
    """The programs for the rest of a mission, by the instruction and the last step."""

    suggestions: tuple[str, ...] = field(default=(), repr=False)  # instructions that need no context
    settings: SamplingSettings = field(default_factory=partial(SamplingSettings, None, None))

    def solution(self, instruction: str, index: int) -> Solution:
        """Return reply number `index`, counted from 0, to an instruction. The replies repeat in a cycle."""
        replies = self.replies[instruction]
        return replies[index % len(replies)]

    async def reply(self, prompt: Prompt, *, number: int, on_text: TextListener = ignore_text) -> Reply:
        """Return a recorded reply at once. Raise UnknownInstructionError if there is none for the prompt."""
        known = {_words(instruction): instruction for instruction in self.replies}
        instruction = known.get(_words(prompt.instruction))
        if instruction is None:
            closest = find_closest(prompt.instruction, self.suggestions)
            raise UnknownInstructionError(self.name, prompt.instruction, closest)
        program = self._program(instruction, number, prompt.last_step)
        on_text(program)
        return Reply(program, program, Usage(), 0.0, "stop")

    def _program(self, instruction: str, number: int, last_step: str) -> str:
        if last_step in {"", NO_STEP}:
            return self.solution(instruction, number).program
        program = self.rests.get((instruction, last_step))
        if program is None:
            what = f"{self.name} has no program that continues this mission after this step: {last_step}"
            raise ModelError(f"{what}; choose a language model, or write the program", is_temporary=False)
        return program

    async def close(self) -> None:
        """Do nothing, because there is nothing to close."""


def find_closest(instruction: str, known: Iterable[str]) -> list[str]:
    """Return the (up to) three known instructions that share the most words of four or more letters."""
    words = {*LONG_WORD.findall(instruction.lower())}

    def rank(other: str) -> tuple[int, int]:
        return -len(words & {*LONG_WORD.findall(other.lower())}), len(other)

    return sorted(known, key=rank)[:MAX_SUGGESTIONS]


def _words(text: str) -> tuple[str, ...]:
    return tuple(text.lower().rstrip(". \n").split())


def is_recorded(name: str) -> bool:
    """Return whether a model's name, such as `recorded:careful`, means a recorded model."""
    return name.partition(":")[0] == "recorded"


def open_recorded(name: str, folder: Path | None = None) -> RecordedModel:
    """Open a model that replays hand-written programs. Raise UserError for an unknown name.

    The name `recorded:DIR` stands for the programs in the folder DIR. `recorded:careful` and `recorded:hasty`
    stand for the built-in programs, and for those in `folder` if it is given.
    """
    short = name.removeprefix("recorded").removeprefix(":") or RECORDED_NAMES[0]
    if short not in RECORDED_NAMES and Path(short).is_dir():
        own = _read(Path(short))
        replies = {one.instruction: one.careful for one in own}
        return RecordedModel(f"recorded:{short}", replies, suggestions=tuple(replies))
    if short not in RECORDED_NAMES:
        known = " or ".join(f"recorded:{known}" for known in RECORDED_NAMES)
        raise UserError(f'unknown recorded model "{name}"; use {known}')
    paper, rules = (_read_suite(suite) for suite in ("paper", "rules"))
    further = () if folder is None else _read(folder)
    solved = (*paper, *rules, *further)
    replies = {one.instruction: one.replies_of(short) for one in solved}
    rests = {
        (one.instruction, step): rest.program
        for one in solved
        for rest in one.continuations
        for step in rest.after
        if rest.right == (short == "careful")
    }
    return RecordedModel(f"recorded:{short}", replies, rests, tuple(one.instruction for one in paper))


@cache
def _read_suite(suite: str) -> tuple[InstructionSolutions, ...]:
    """Read the instructions of a benchmark suite. The paper's suite includes this folder's instructions."""
    return _read(*_suite_folders(suite), *([RECORDED_FOLDER] if suite == "paper" else []))


def _read(*folders: Path) -> tuple[InstructionSolutions, ...]:
    files = sorted((f for folder in folders for f in folder.glob("*.yaml")), key=lambda file: file.name)
    forms = (YamlFile.read(file).validate(RecordedFile) for file in files)
    return tuple(one for form in forms for one in form.recorded)


def _suite_folders(suite: str) -> Iterator[Path]:
    # Locate the solutions as data, since codebotler must not import the code of roboeval.
    benchmark = find_spec("roboeval")
    for place in (benchmark and benchmark.submodule_search_locations) or ():
        yield Path(place, "suites", suite, "solutions")
