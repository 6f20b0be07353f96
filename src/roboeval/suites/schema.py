"""Defines the schema of suite.yaml and of task files."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from codebotler.core.text.labels import check_regex
from codebotler.core.world_file import AnswerFile, Name, NamePattern, PersonFile, WorldFile, YamlText
from codebotler.simulator.settings import Limits, SimulationSettings
from codebotler.simulator.worlds.matching import WORDS_FOR_PEOPLE, Matching

MAX_WORLDS = 10_000  # per task; this many worlds already need a gigabyte of memory and minutes to sample

Category = Literal[
    "SayAtLocation",
    "AskAtLocation",
    "ManipulationAtLocation",
    "CheckEntityAtLocation",
    "InitialTerminal",
    "EventOrdering",
    "Location",
    "ExhaustiveSearch",
]
Ability = Literal[
    "navigation",
    "perception",
    "conversation",
    "manipulation",
    "announcement",
    "report-back",
    "waiting",
    "arithmetic",
    "commonsense",
]


class StrictForm(BaseModel):
    """Base class for file contents, in which unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class CheckFile(StrictForm):
    """A check in a task file: a formula that requirements name, such as `asks_in(room)`.

    Args:
        means: by kind of event, what its regex means, as shown in explanations. A plain string is for `say`.
    """

    category: Category  # the kind of failure if the check fails
    commonsense: bool = False  # whether the check tests something that no prompt mentions
    rtl: YamlText  # the formula in RTL
    means: Annotated[
        dict[str, Name], BeforeValidator(lambda means: {"say": means} if isinstance(means, str) else means)
    ] = {}


class TaskFact(StrictForm):
    """A fact in an instruction, such as "she is in her office", on which requirements depend.

    Args:
        words: regexes. Each prompt must match at least one; if the fact is common sense, it must match none.
    """

    fact: YamlText  # a sentence that states the fact
    words: Annotated[tuple[Annotated[YamlText, AfterValidator(check_regex)], ...], Field(min_length=1)]
    commonsense: bool = False  # whether the model must know the fact although no prompt mentions it


class RequirementFile(StrictForm):
    """A requirement in a task file: a string, or a mapping if only some prompts ask for it.

    Args:
        prompts: for each prompt, by number from 0, the words in it that ask for the requirement.
    """

    check: YamlText  # the check, optionally with `not`; in sampled worlds also with `for` or `if`
    prompts: Annotated[dict[Annotated[int, Field(ge=0, lt=10_000)], Name], Field(min_length=1)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _from_text(cls, data: object) -> object:
        return {"check": data} if isinstance(data, str) else data


Require = Annotated[list[RequirementFile], Field(min_length=1)]


class AcceptedFinding(StrictForm):
    """A linter finding that is intended, with the reason."""

    finding: YamlText
    because: YamlText


class ScenarioFile(WorldFile):
    """A world in a task file, with its requirements.

    To judge common sense only, `ablation` replaces `require`, and `ablation_people` replaces `people`.
    """

    about: Name
    require: Require
    ablation: list[RequirementFile] | None = None
    ablation_people: dict[str, list[PersonFile]] | None = None


Levels = Annotated[list[YamlText], Field(min_length=1)] | YamlText
IN_NO_ROOM = "nowhere"
Answers = AnswerFile | Annotated[list[AnswerFile], Field(min_length=1)]
Looks = Annotated[int, Field(strict=True, ge=0, le=1_000)]


class SampledPersonFile(StrictForm):
    """A person who may be in sampled worlds. Each world samples one entry from each list."""

    name: NamePattern | None = None
    where: Levels = Field(alias="in")
    answers: list[Answers] = []
    topics: dict[NamePattern, Answers] = {}
    after_looks: Looks | list[Looks] = 0
    leaves: Annotated[bool, Field(strict=True)] = False


class SampledThingFile(StrictForm):
    """An object in sampled worlds. Each world puts it into one room of the list `in`, or `nowhere`."""

    label: NamePattern | None = None
    where: Levels = Field(alias="in")


class CornerFile(StrictForm):
    """A world of a sampled task with some values set by hand. Other values are the first in their lists."""

    about: Name
    set: dict[Name, AnswerFile | Annotated[int, Field(strict=True)]] = {}


class SampledWorldsFile(StrictForm):
    """Lists the rooms, people and things from which the worlds of a task are sampled."""

    robot: Levels
    rooms: Annotated[list[NamePattern], Field(min_length=1)]
    people: dict[NamePattern, SampledPersonFile] = {}
    things: dict[NamePattern, SampledThingFile] = {}
    may_wait_forever: YamlText | Annotated[bool, Field(strict=True)] = False
    corners: list[CornerFile] = []


class _AnyTaskFile(StrictForm):
    name: Name
    summary: Name
    abilities: tuple[Ability, ...] = ()
    prompts: Annotated[list[Name], Field(min_length=1)]
    facts: tuple[TaskFact, ...] = ()
    covered_by: dict[Name, Annotated[list[Name], Field(min_length=1)] | Name] = {}
    checks: dict[str, CheckFile]
    accepted: tuple[AcceptedFinding, ...] = ()


class TaskFile(_AnyTaskFile):
    """A task file that lists its worlds."""

    worlds: Annotated[list[ScenarioFile], Field(min_length=1)]


class SampledTaskFile(_AnyTaskFile):
    """A task file whose worlds are sampled. `let` names values, and `phrases` names lists of regexes."""

    worlds: SampledWorldsFile
    let: dict[Name, Annotated[str, BeforeValidator(str)]] = {}
    phrases: dict[Name, Annotated[tuple[Name, ...], Field(min_length=1)]] = {}
    require: Require


class LimitsFile(StrictForm):
    """The limits of one run of a program, in suite.yaml. `ticks` are loop iterations and function calls."""

    seconds: Annotated[float, Field(strict=True, gt=0, le=1e9, allow_inf_nan=False)] = 3600.0  # simulated
    calls: Annotated[int, Field(strict=True, gt=0, le=1_000_000_000)] = 1_000  # of skills
    ticks: Annotated[int, Field(strict=True, gt=0, le=1_000_000_000)] = 200_000


def _moment(value: object) -> object:
    if isinstance(value, datetime) and value.tzinfo is not None and 1970 <= value.year < 2100:  # noqa: PLR2004 - the message names these years
        return value
    raise ValueError("use a time from 1970 to 2099 with an offset, such as 2024-01-01T12:00:00+00:00")


class SimulationFile(StrictForm):
    """The simulation settings under `rules` in suite.yaml, such as the limits and the start of the clock."""

    literals: Literal["lowercase", "as-written"] = "lowercase"
    matching: Matching = "label-in-request"
    people: Literal["answer-to-any-name", "own-name-or-word"] = "answer-to-any-name"
    words_for_people: tuple[NamePattern, ...] = ()
    words_for_yes: tuple[NamePattern, ...] = ()
    words_for_no: tuple[NamePattern, ...] = ()
    events: Literal["as-requested", "as-happened"] = "as-requested"
    limits: LimitsFile = LimitsFile()
    skill_seconds: Literal[0] = 0
    clock_starts: Annotated[datetime, BeforeValidator(_moment)] = SimulationSettings().clock_starts

    @model_validator(mode="before")
    @classmethod
    def _usual_words(cls, data: object) -> object:
        if isinstance(data, dict) and data.get("people") == "own-name-or-word":
            return {"words_for_people": WORDS_FOR_PEOPLE, **data}
        return data

    def settings(self) -> SimulationSettings:
        """Convert the file content to simulation settings."""
        values = {name: value for name, value in self if name != "skill_seconds"}
        return SimulationSettings(**values | {"limits": Limits(**dict(self.limits))})


class SuiteFile(StrictForm):
    """The content of suite.yaml: the suite's name and version, its worlds, and its simulation settings."""

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9-]*$")]
    version: Annotated[int, Field(strict=True, ge=0)]
    about: YamlText = ""
    instructions: Annotated[str, Field(pattern=r"^[a-z][a-z0-9-]*$")] | None = None
    worlds: Annotated[int, Field(strict=True, ge=1, le=MAX_WORLDS)] = 30
    seed: Annotated[int, Field(strict=True, ge=0)] = 1
    rules: SimulationFile = SimulationFile()
    house_rules: Name | None = None  # a file in the suite with rules that stop programs
    skills: list[Name] = []  # files in the suite that declare additional skills
