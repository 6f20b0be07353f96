"""Worlds drawn from a description, and what each of them requires."""

from __future__ import annotations

import ast
import fnmatch
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from random import Random
from typing import Any, TypeAlias

from codebotler.badinput import Place, YamlFile
from codebotler.cachedproperty import cached_property
from codebotler.world import OptionFile, Person, Room, World
from roboeval.suites.expression import ExpressionError, Names, PersonFact, ThingFact, each_of, parsed, value
from roboeval.suites.pairwise import Row, spread
from roboeval.suites.schema import (
    NOWHERE,
    CornerFile,
    DrawnPersonFile,
    DrawnTaskFile,
    DrawnThingFile,
    DrawnWorldsFile,
)

Level: TypeAlias = str | int
"""Something that may be the case: a room, an answer, a position among the options, a number of looks."""


@dataclass(frozen=True)
class Setting:
    """What is the case in one world.

    Args:
        about: what is special in it.
        chosen: for each factor, which of its levels.
        rooms: in the order in which the robot knows them.
    """

    about: str
    chosen: Mapping[str, Level]
    rooms: tuple[str, ...]


@dataclass(frozen=True)
class Description:
    """What a task says of its worlds.

    Args:
        form: the task file.
        file: where it stands.
    """

    form: DrawnTaskFile
    file: YamlFile

    @property
    def worlds(self) -> DrawnWorldsFile:
        """What it says of the worlds themselves."""
        return self.form.worlds

    @cached_property
    def factors(self) -> dict[str, tuple[Level, ...]]:
        """Whatever there is to choose from in a world, by name, such as `alice.in` and `alice.answer 1`."""
        found: dict[str, tuple[Level, ...]] = {}
        for name, person in self.worlds.people.items():
            found[f"{name}.in"] = self._rooms(person.where, ("people", name, "in"))
            for number, answers in enumerate(person.answers, 1):
                found[f"{name}.answer {number}"] = _levels(answers)
            for topic, answers in person.topics.items():
                found[f"{name}.topic {topic}"] = _levels(answers)
            found[f"{name}.after_looks"] = _levels(person.after_looks)
        for name, thing in self.worlds.things.items():
            found[f"{name}.in"] = self._rooms(thing.where, ("things", name, "in"))
        return found

    def _rooms(self, where: str | list[str], place: Place) -> tuple[Level, ...]:
        levels = _levels(where)
        for level in levels:
            if level != NOWHERE and level not in self.worlds.rooms:
                sentence = (
                    f'there is no room "{level}"; there is {", ".join(self.worlds.rooms)} and {NOWHERE}'
                )
                raise self.file.wrong(sentence, "worlds", *place)
        return levels

    def settings(self, count: int, seed: int) -> Iterator[Setting]:
        """The corners, and behind them worlds in which every two levels of two factors meet.

        Args:
            count: how many at least; fewer only where there are no more.
            seed: from which they are drawn.
        """
        free = {factor: len(levels) for factor, levels in self.factors.items() if len(levels) > 1}
        random = Random(f"{self.form.name} {seed}")  # noqa: S311 - no secret
        corners = [self._corner(corner, number) for number, corner in enumerate(self.worlds.corners)]
        yield from corners
        seen = {_identity(corner) for corner in corners}
        rows = spread(free, max(1, count - len(corners)), random) if free else [{}] * (count - len(corners))
        for number, row in enumerate(rows, len(corners) + 1):
            for _ in range(_TRIES):
                setting = self._drawn(row, number, random)
                if _identity(setting) not in seen:
                    seen.add(_identity(setting))
                    yield setting
                    break

    def _drawn(self, row: Row, number: int, random: Random) -> Setting:
        chosen = {factor: levels[row.get(factor, 0)] for factor, levels in self.factors.items()}
        rooms = random.sample(self.worlds.rooms, len(self.worlds.rooms))
        return Setting(f"{number}: {self._told(chosen)}", chosen, tuple(rooms))

    def _corner(self, corner: CornerFile, number: int) -> Setting:
        chosen = {factor: levels[0] for factor, levels in self.factors.items()}
        for pattern, wanted in corner.set.items():
            level = wanted.option if isinstance(wanted, OptionFile) else wanted
            named = fnmatch.filter(self.factors, pattern)
            fitting = [
                f for f in named if level in self.factors[f] or (level == NOWHERE and f.endswith(".in"))
            ]
            chosen.update(dict.fromkeys(fitting, level))
            if not fitting:
                known = ", ".join(f for f, levels in self.factors.items() if len(levels) > 1)
                sentence = f'nothing that "{pattern}" names can be "{level}"; there is {known}'
                raise self.file.wrong(sentence, "worlds", "corners", number, "set")
        return Setting(corner.about, chosen, tuple(self.worlds.rooms))

    def _told(self, chosen: Mapping[str, Level]) -> str:
        """What is the case, in a few words: who and what is where, and what people answer."""
        parts = []
        everything: dict[str, DrawnPersonFile | DrawnThingFile] = {**self.worlds.people, **self.worlds.things}
        for name, thing in everything.items():
            room = chosen[f"{name}.in"]
            places = [level for level in _levels(thing.where) if level != NOWHERE]
            told = [f"in {room}"] if len(places) > 1 and room != NOWHERE else []
            for factor, level in chosen.items():
                if factor.startswith(f"{name}.") and len(self.factors[factor]) > 1 and factor != f"{name}.in":
                    topic = factor.partition(" ")[2]
                    prefix = (
                        f"{topic} " if ".topic " in factor else "after looks " if "looks" in factor else ""
                    )
                    told.append(f"{prefix}{level}")
            is_told = told or len(_levels(thing.where)) > 1
            if room == NOWHERE:
                parts.append(f"{name} out")
            elif is_told:
                parts.append(f"{name} {', '.join(told)}" if told else f"{name} in")
        return "; ".join(parts) or "rooms in another order"

    def world(self, setting: Setting) -> World:
        """The world of a setting.

        Raises:
            BadInput: what it may wait for cannot be computed.
        """
        rooms = []
        for room in setting.rooms:
            labels = [t.label for t in self._things(setting) if t.room == room]
            here = [name for name in self.worlds.people if setting.chosen[f"{name}.in"] == room]
            people = [self._person(name, setting) for name in here]
            rooms.append(Room(room, tuple(labels), tuple(people)))
        wait = self.worlds.may_wait_forever
        if isinstance(wait, str):
            wait = bool(self._computed(wait, self.names(setting), "worlds", "may_wait_forever"))
        return World(tuple(rooms), self.worlds.robot, setting.about, wait)

    def _person(self, name: str, setting: Setting) -> Person:
        form, chosen = self.worlds.people[name], setting.chosen
        answers = tuple(chosen[f"{name}.answer {n + 1}"] for n in range(len(form.answers)))
        topics = tuple((topic, chosen[f"{name}.topic {topic}"]) for topic in form.topics)
        return Person(form.name or name, answers, topics, int(chosen[f"{name}.after_looks"]), form.leaves)

    def _things(self, setting: Setting) -> Iterator[ThingFact]:
        for name, form in self.worlds.things.items():
            room = str(setting.chosen[f"{name}.in"])
            yield ThingFact(name, form.label or name, "" if room == NOWHERE else room)

    def names(self, setting: Setting) -> Names:
        """What the requirements of a world may name.

        Raises:
            BadInput: something under `let` cannot be computed.
        """
        people = []
        for name in self.worlds.people:
            one = self._person(name, setting)
            room = "" if (where := str(setting.chosen[f"{name}.in"])) == NOWHERE else where
            people.append(PersonFact(name, room, one.answers, dict(one.topics), one.after_looks))
        names: dict[str, Any] = {"people": people, "things": [*self._things(setting)], "rooms": setting.rooms}
        for name, text in self.form.let.items():
            names[name] = self._computed(text, names, "let", name)
        return names

    def _computed(self, text: str, names: Names, *place: str) -> Any:  # noqa: ANN401 - texts, numbers, lists
        try:
            return value(parsed(text), names)
        except ExpressionError as error:
            raise self.file.wrong(str(error), *place) from None

    def requirements(self, setting: Setting) -> Iterator[tuple[str, int]]:
        """What a world requires, as a task that lists its worlds would say it, and which entry says so.

        Raises:
            BadInput: an entry cannot be read or computed.
        """
        names = self.names(setting)
        for number, text in enumerate(self.form.require):
            try:
                for one in _required(text, names):
                    yield one, number
            except ExpressionError as error:
                raise self.file.wrong(str(error), "require", number) from None


_TRIES = 50  # draws for a world that is not there yet

Form: TypeAlias = str | int | OptionFile
"""A level as a task file writes it."""


def _levels(form: Form | Sequence[Form]) -> tuple[Level, ...]:
    items: Sequence[Form] = [form] if isinstance(form, str | int | OptionFile) else form
    return tuple(item.option if isinstance(item, OptionFile) else item for item in items)


def _identity(setting: Setting) -> tuple[object, ...]:
    """What tells a world from others: of who is nowhere, the answers do not count."""
    absent = {_owner(factor) for factor, level in setting.chosen.items() if level == NOWHERE}
    chosen = setting.chosen.items()
    return setting.rooms, *(one for one in chosen if one[1] == NOWHERE or _owner(one[0]) not in absent)


def _owner(factor: str) -> str:
    return factor.partition(".")[0]


def _required(text: str, names: Names) -> Iterator[str]:
    """The requirements that an entry stands for: `check(x)`, `... if CONDITION`, `... for NAME in LIST`."""
    try:
        node = parsed(f"({text})")
    except ExpressionError:
        node = parsed(f"({text} else None)")
    match node:
        case ast.IfExp(test, body, ast.Constant(None)):
            if value(test, names):
                yield _called(body, names)
        case ast.GeneratorExp(body, [loop]):
            for each in each_of(loop, names):
                yield _called(body, each)
        case _:
            yield _called(node, names)


def _called(node: ast.expr, names: Names) -> str:
    match node:
        case ast.UnaryOp(ast.Not(), inner):
            return f"not {_called(inner, names)}"
        case ast.Name(name):
            return name
        case ast.Call(ast.Name(name), arguments, []):
            return f"{name}({', '.join(_written(value(argument, names)) for argument in arguments)})"
    raise ExpressionError(f'"{ast.unparse(node)}" is no requirement; write check, check(x) or not check(x)')


def _written(argument: object) -> str:
    if isinstance(argument, str | int) and not isinstance(argument, bool):
        return json.dumps(argument, ensure_ascii=False)
    raise ExpressionError(f"an argument of a check is a text or a number, not {argument}")
