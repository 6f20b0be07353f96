"""What a suite.yaml and a task file may say."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from codebotler.core.labels import check_regex
from codebotler.core.world_file import AnswerFile, Name, NamePattern, PersonFile, WorldFile, YamlText
from codebotler.simulator.settings import WORDS_FOR_PEOPLE, Limits, SimulationSettings

MOST_WORLDS = 10_000  # of one task; a whole suite then takes a gigabyte of memory, and minutes to draw

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


class _Form(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


def _of_what_is_said(means: object) -> object:
    return {"say": means} if isinstance(means, str) else means


class CheckFile(_Form):
    """A check as a task file writes it.

    Args:
        category: the class of failure.
        commonsense: whether it tests what no prompt says.
        rtl: the constraint.
        means: by the kind of event, what its texts come to in a sentence; a single text is what is said.
    """

    category: Category
    commonsense: bool = False
    rtl: YamlText
    means: Annotated[dict[str, Name], BeforeValidator(_of_what_is_said)] = {}


class Fact(_Form):
    """Something the requirements of a task rest on.

    Args:
        fact: what it is, in a sentence.
        words: regexes; at least one is found in every prompt, or none in any if it is common sense.
        commonsense: whether the model must know it without being told.
    """

    fact: YamlText
    words: Annotated[tuple[Annotated[YamlText, AfterValidator(check_regex)], ...], Field(min_length=1)]
    commonsense: bool = False


class RequirementFile(_Form):
    """A requirement as a task file writes it: a text, or a mapping if only some prompts ask for it.

    Args:
        check: the check, perhaps with `not`, and in drawn worlds with `for` or `if`.
        prompts: by the number of each prompt that asks for it, counted from 0, the words that do.
    """

    check: YamlText
    prompts: Annotated[dict[Annotated[int, Field(ge=0, lt=10_000)], Name], Field(min_length=1)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _from_text(cls, data: object) -> object:
        return {"check": data} if isinstance(data, str) else data


Require = Annotated[list[RequirementFile], Field(min_length=1)]


class Accepted(_Form):
    """A finding of the linter that is there on purpose, and why."""

    finding: YamlText
    because: YamlText


class ScenarioFile(WorldFile):
    """A world with its requirements as a task file writes it."""

    about: Name
    require: Require
    ablation: list[RequirementFile] | None = None
    ablation_people: dict[str, list[PersonFile]] | None = None


Levels = Annotated[list[YamlText], Field(min_length=1)] | YamlText
NOWHERE = "nowhere"
Answers = AnswerFile | Annotated[list[AnswerFile], Field(min_length=1)]
Looks = Annotated[int, Field(strict=True, ge=0, le=1_000)]


class DrawnPersonFile(_Form):
    """A person who may be in the worlds of a task; where there is a choice, it is drawn for each world."""

    name: NamePattern | None = None
    where: Levels = Field(alias="in")
    answers: list[Answers] = []
    topics: dict[NamePattern, Answers] = {}
    after_looks: Looks | list[Looks] = 0
    leaves: Annotated[bool, Field(strict=True)] = False


class DrawnThingFile(_Form):
    """A thing that may lie in the worlds of a task."""

    label: NamePattern | None = None
    where: Levels = Field(alias="in")


class CornerFile(_Form):
    """A world that a task sets by hand; what it leaves out is the first of the choices."""

    about: Name
    set: dict[Name, AnswerFile | Annotated[int, Field(strict=True)]] = {}


class DrawnWorldsFile(_Form):
    """What the worlds of a task have in common, and what may differ."""

    robot: Levels
    rooms: Annotated[list[NamePattern], Field(min_length=1)]
    people: dict[NamePattern, DrawnPersonFile] = {}
    things: dict[NamePattern, DrawnThingFile] = {}
    may_wait_forever: YamlText | Annotated[bool, Field(strict=True)] = False
    corners: list[CornerFile] = []


class _AnyTaskFile(_Form):
    name: Name
    summary: Name
    abilities: tuple[Ability, ...] = ()
    prompts: Annotated[list[Name], Field(min_length=1)]
    facts: tuple[Fact, ...] = ()
    covered_by: dict[Name, Annotated[list[Name], Field(min_length=1)] | Name] = {}
    checks: dict[str, CheckFile]
    accepted: tuple[Accepted, ...] = ()


class TaskFile(_AnyTaskFile):
    """A task file that lists its worlds."""

    worlds: Annotated[list[ScenarioFile], Field(min_length=1)]


class DrawnTaskFile(_AnyTaskFile):
    """A task file that describes its worlds."""

    worlds: DrawnWorldsFile
    let: dict[Name, Annotated[str, BeforeValidator(str)]] = {}
    phrases: dict[Name, Annotated[tuple[Name, ...], Field(min_length=1)]] = {}
    require: Require


class LimitsFile(_Form):
    """The limits as a suite file writes them."""

    seconds: Annotated[float, Field(strict=True, gt=0, le=1e9, allow_inf_nan=False)] = 3600.0
    calls: Annotated[int, Field(strict=True, gt=0, le=1_000_000_000)] = 1_000
    ticks: Annotated[int, Field(strict=True, gt=0, le=1_000_000_000)] = 200_000


def _moment(value: object) -> object:
    if isinstance(value, datetime) and value.tzinfo is not None and 1970 <= value.year < 2100:  # noqa: PLR2004 - years
        return value
    raise ValueError(
        "it should be a time from 1970 to 2099 with its offset, such as 2024-01-01T12:00:00+00:00"
    )


class RulesFile(_Form):
    """The rules as a suite file writes them."""

    literals: Literal["lowercase", "as-written"] = "lowercase"
    matching: Literal["label-in-request", "whole-words"] = "label-in-request"
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

    def rules(self) -> SimulationSettings:
        """The rules it describes."""
        values = {name: value for name, value in self if name != "skill_seconds"}
        return SimulationSettings(**values | {"limits": Limits(**dict(self.limits))})


class SuiteFile(_Form):
    """A suite.yaml."""

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9-]*$")]
    version: Annotated[int, Field(strict=True, ge=0)]
    about: YamlText = ""
    instructions: Annotated[str, Field(pattern=r"^[a-z][a-z0-9-]*$")] | None = None
    worlds: Annotated[int, Field(strict=True, ge=1, le=MOST_WORLDS)] = 30
    seed: Annotated[int, Field(strict=True, ge=0)] = 1
    rules: RulesFile = RulesFile()
    house_rules: Name | None = None  # a file of the suite: no program may break its rules
    skills: list[Name] = []  # files of the suite that declare further skills
