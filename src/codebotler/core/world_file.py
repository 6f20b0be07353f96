"""Read YAML descriptions of worlds, alone or inside a task, and report mistakes in them."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, TypeAlias

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    StrictBool,
    StrictFloat,
    StrictInt,
    StrictStr,
    StringConstraints,
    Tag,
)

from codebotler.core.program import literal, parse_expression
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.skills.values import Scalar, plain, written_call
from codebotler.core.text.labels import check_label
from codebotler.core.text.words import listed
from codebotler.core.world import Answer, Person, Room, Trait, World, is_within
from codebotler.core.yaml_files import YamlFile, YamlPath


def read_world(path: Path, skills: SkillTable | None = None) -> World:
    """Read a world file; raise UserError with the line of a mistake and its fix.

    Args:
        path: the file.
        skills: the skills whose results it may define; None to allow any.
    """
    file = YamlFile.read(path)
    return file.validate(WorldFile).world(file, skills=skills)


YamlText = Annotated[str, StringConstraints(strict=True)]
Name = Annotated[str, StringConstraints(strict=True, min_length=1)]


Pattern = Annotated[YamlText, AfterValidator(check_label)]
NamePattern = Annotated[Name, AfterValidator(check_label)]
YamlValue: TypeAlias = StrictBool | StrictInt | StrictFloat | StrictStr
Metres = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e6, le=1e6)]
Corner: TypeAlias = tuple[Metres, Metres]


class _Form(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


def _not_zero(option: int) -> int:
    if option == 0:
        raise ValueError("there is no option 0; 1 is the first, and -1 the last")
    return option


class OptionFile(_Form):
    """An answer in a world file by its position: `option: 1` means the first option."""

    option: Annotated[int, Field(strict=True, ge=-100, le=100), AfterValidator(_not_zero)]


AnswerFile = Annotated[
    Annotated[Pattern, Tag("text")] | Annotated[OptionFile, Tag("option")],
    Discriminator(lambda value: "option" if isinstance(value, dict | OptionFile) else "text"),
]


MAY_BE_NAME = BeforeValidator(lambda data: data if isinstance(data, dict | BaseModel) else {"name": data})


class _Described(BaseModel):
    """A thing or person, with any further properties."""

    model_config = ConfigDict(extra="allow", frozen=True)

    name: NamePattern

    @property
    def traits(self) -> tuple[Trait, ...]:
        """The properties of the thing or person, such as `("wears", "red coat")`."""
        extra = (self.model_extra or {}).items()
        return tuple((key, tuple(value) if isinstance(value, list) else value) for key, value in extra)

    def wrong_traits(self) -> Iterator[tuple[str, str]]:
        """Yield the name of each property that is not valid, and what is wrong with it."""
        for key, value in (self.model_extra or {}).items():
            alike = get_close_matches(key, type(self).model_fields, 1, cutoff=0.75)
            if alike:
                yield key, f'"{key}" is unknown here; did you mean {alike[0]}?'
            texts = value if isinstance(value, list) else []
            if not isinstance(value, str | int | float | list) or not all(isinstance(t, str) for t in texts):
                yield key, f'"{key}" must be a string, a number, true, false or a list of texts'


ThingFile: TypeAlias = Annotated[_Described, MAY_BE_NAME]
"""A thing in a world file: a label, alone or with properties."""


class PersonFile(_Described):
    """A person in a world file, with scripted answers and perhaps properties."""

    answers: list[AnswerFile] = []
    topics: dict[NamePattern, AnswerFile] = {}
    after_looks: Annotated[int, Field(strict=True, ge=0, le=1_000)] = 0
    leaves: Annotated[bool, Field(strict=True)] = False

    def person(self) -> Person:
        """Convert the entry to a Person."""
        topics = tuple((topic, _answer(answer)) for topic, answer in self.topics.items())
        answers = tuple(map(_answer, self.answers))
        return Person(self.name, answers, topics, self.after_looks, self.leaves)


def _answer(form: AnswerFile) -> Answer:
    return form.option if isinstance(form, OptionFile) else form


class PlaceFile(_Form):
    """A place in a world file, such as a table: its name, and optionally its corners and where to stand."""

    name: NamePattern
    footprint: Annotated[list[Corner], Field(min_length=3)] | None = None
    stand_at: Corner | None = None


class RoomFile(PlaceFile):
    """A room in a world file, with the places in it."""

    places: list[Annotated[PlaceFile, MAY_BE_NAME]] = []


class WorldFile(_Form):
    """The content of a world file or of a world in a task file: rooms, things, people and truths."""

    about: YamlText = ""
    robot: Name
    rooms: Annotated[list[Annotated[RoomFile, MAY_BE_NAME]], Field(min_length=1, max_length=5_000)]
    objects: dict[YamlText, list[ThingFile]] = {}
    people: dict[YamlText, list[PersonFile]] = {}
    may_wait_forever: Annotated[bool, Field(strict=True)] = False
    truths: dict[Name, YamlValue | list[YamlValue]] = {}

    def _truths(
        self, file: YamlFile, at: YamlPath, skills: SkillTable | None
    ) -> Iterator[tuple[str, Scalar | tuple[Scalar, ...]]]:
        for statement, value in self.truths.items():
            try:
                asked = _truth(statement, value, skills)
            except ValueError as error:
                raise file.wrong(str(error), *at, statement) from None
            yield asked, tuple(value) if isinstance(value, list) else value

    def world(self, file: YamlFile, at: YamlPath = (), skills: SkillTable | None = None) -> World:
        """Convert the content, which is at `at` in the file, to a World. Raise UserError for a mistake."""
        names: dict[str, str] = {}  # by lower-case name
        for where, room, _ in self._goals():
            if other := names.get(room.name.lower()):
                sentence = f'the room "{room.name}" is already listed as "{other}"; rename or remove one'
                raise file.wrong(sentence, *at, *where)
            names[room.name.lower()] = room.name
            if room.stand_at and room.footprint and not is_within(room.stand_at, room.footprint):
                point = f"({room.stand_at[0]:g}, {room.stand_at[1]:g})"
                sentence = f'the robot would stand at {point}, outside the footprint of "{room.name}"'
                raise file.wrong(f"{sentence}; move the point", *at, *where, "stand_at")
        rooms = dict.fromkeys(names.values())
        known = ", ".join(rooms)
        if self.robot not in rooms:
            raise file.wrong(f'the robot starts in "{self.robot}", but the rooms are: {known}', *at, "robot")
        for key, named in (("objects", self.objects), ("people", self.people)):
            for name in named:
                if name not in rooms:
                    raise file.wrong(f'there is no room "{name}"; the rooms are: {known}', *at, key, name)
        return World(
            rooms=tuple(
                Room(
                    name=room.name,
                    objects=tuple(thing.name for thing in self.objects.get(room.name, ())),
                    people=tuple(person.person() for person in self.people.get(room.name, ())),
                    footprint=None if room.footprint is None else tuple(room.footprint),
                    stand_at=room.stand_at,
                    within=within,
                )
                for _, room, within in self._goals()
            ),
            robot=self.robot,
            about=self.about,
            may_wait_forever=self.may_wait_forever,
            truths=tuple(self._truths(file, (*at, "truths"), skills)),
            traits=tuple(self._traits(file, at).items()),
        )

    def _goals(self) -> Iterator[tuple[YamlPath, PlaceFile, str]]:
        """Yield each room and the places in it, with its path in the file and the room that contains it."""
        for index, room in enumerate(self.rooms):
            yield ("rooms", index), room, ""
            for number, place in enumerate(room.places):
                yield ("rooms", index, "places", number), place, room.name

    def _traits(self, file: YamlFile, at: YamlPath) -> dict[str, tuple[Trait, ...]]:
        found: dict[str, tuple[Trait, ...]] = {}
        for key, named in (("objects", self.objects), ("people", self.people)):
            for room, entries in named.items():
                for number, entry in enumerate(entries):
                    for trait, sentence in entry.wrong_traits():
                        raise file.wrong(sentence, *at, key, room, number, trait)
                    if found.get(entry.name, entry.traits) != entry.traits:
                        sentence = f'"{entry.name}" is described twice, and differently; rename one'
                        raise file.wrong(sentence, *at, key, room, number)
                    if entry.traits:
                        found[entry.name] = entry.traits
        return found


_CALL = re.compile(r"\w+\(.*\)")


def _truth(statement: str, value: object, skills: SkillTable | None) -> str:
    """Return a statement in the form that skills use, or raise ValueError if its value is impossible."""
    if not _CALL.fullmatch(statement):
        if isinstance(value, list):
            raise ValueError(f'the value of "{statement}" is a list; write a single value')
        return statement
    name, given = _parse_call(statement)
    if not name:
        raise ValueError(f'"{statement}" is not a call; write it as in read_gauge("boiler")')
    if skills is not None and len(skills) > len(SKILLS):
        _expect_possible(name, given, value, skills)
        taken = zip(skills[name].parameters, given, strict=True)
        given = [plain(parameter.type.convert(one)) for parameter, one in taken]
    return written_call(name, given)


def _parse_call(statement: str) -> tuple[str, list[object]]:
    """Return the name and the arguments of a call, or an empty name if the statement is not one."""
    with suppress(SyntaxError, ValueError, RecursionError):
        match parse_expression(statement):
            case ast.Call(ast.Name(name), arguments, []):
                return name, [literal(one) for one in arguments]
    return "", []


def _expect_possible(name: str, given: list[object], value: object, skills: SkillTable) -> None:
    """Raise ValueError if a call cannot return this value, or if the skill's code computes its result."""
    row = skills.get(name)
    if row is None or not row.is_random:
        raise ValueError(f"{name} is not a skill with an empty body; set facts that it reads, not its result")
    taken = zip(row.parameters, given, strict=True)
    if len(given) != len(row.parameters) or not all(parameter.type.fits(one) for parameter, one in taken):
        raise ValueError(f"the arguments of {name} are wrong; its signature is {row.signature}")
    kinds = [kind for kind, _ in row.fails]
    if value in kinds or (row.returns.base is not None and row.returns.fits(value)):
        return
    returned = [] if row.returns.base is None else [row.returns.in_words]
    raise ValueError(f"{name} cannot return {value!r}; write {listed([*returned, *kinds], 'or')}")
