"""Samples worlds, with their requirements, from the description in a task file."""

from __future__ import annotations

import ast
import fnmatch
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from random import Random
from types import SimpleNamespace
from typing import Any, TypeAlias

from codebotler.core.cachedproperty import cached_property
from codebotler.core.text.words import listed
from codebotler.core.world import Person, Room, World
from codebotler.core.world_file import OptionFile
from codebotler.core.yaml_files import YamlFile
from codebotler.rtl.regex_words import first_choice
from roboeval.suites.sampling.expression import ExpressionError, Names, evaluate, iterate_loop, parse_cached
from roboeval.suites.sampling.pairwise import sample_combinations
from roboeval.suites.schema import IN_NO_ROOM, CornerFile, SampledTaskFile

FactorLevel: TypeAlias = str | int  # a room, an answer, an index of an option, or a number of looks

ROBOT_FACTOR = "robot"  # the factor for the starting room
_TRIES = 50  # attempts to sample a new world


@dataclass(frozen=True)
class Setting:
    """The choices that make one world, such as `kitchen` for `alice.in`, the room where Alice is."""

    about: str
    chosen: Mapping[str, FactorLevel]
    rooms: tuple[str, ...]  # all rooms, in the order the robot lists them

    def room(self, name: str) -> str:
        """Return the room of a person or thing, or an empty string if it is in no room."""
        room = str(self.chosen[f"{name}.in"])
        return "" if room == IN_NO_ROOM else room

    @property
    def start(self) -> str:
        """Return the room where the robot starts."""
        return str(self.chosen[ROBOT_FACTOR])

    @property
    def identity(self) -> tuple[object, ...]:
        """Return a key to find duplicate worlds. It ignores answers of absent people: nobody can ask them."""
        absent = {_owner(factor) for factor, level in self.chosen.items() if level == IN_NO_ROOM}
        chosen = self.chosen.items()
        return self.rooms, *(one for one in chosen if one[1] == IN_NO_ROOM or _owner(one[0]) not in absent)


@dataclass(frozen=True)
class WorldSampler:
    """Samples worlds from the description in a task file."""

    form: SampledTaskFile
    file: YamlFile

    @cached_property
    def factors(self) -> dict[str, tuple[FactorLevel, ...]]:
        """Return the possible values by factor: for `alice.in`, these are the rooms where Alice may be."""
        found = {ROBOT_FACTOR: self._rooms(self.form.worlds.robot, ROBOT_FACTOR)}
        for name, person in self.form.worlds.people.items():
            found[f"{name}.in"] = self._rooms(person.where, "people", name, "in")
            for number, answers in enumerate(person.answers, 1):
                found[f"{name}.answer {number}"] = _levels(answers)
            for topic, answers in person.topics.items():
                found[f"{name}.topic {topic}"] = _levels(answers)
            found[f"{name}.after_looks"] = _levels(person.after_looks)
        for name, thing in self.form.worlds.things.items():
            found[f"{name}.in"] = self._rooms(thing.where, "things", name, "in")
        return found

    @cached_property
    def _free(self) -> dict[str, int]:
        return {factor: len(levels) for factor, levels in self.factors.items() if len(levels) > 1}

    def _rooms(self, where: str | list[str], *place: str) -> tuple[FactorLevel, ...]:
        known = self.form.worlds.rooms if place == (ROBOT_FACTOR,) else [*self.form.worlds.rooms, IN_NO_ROOM]
        for room in _levels(where):
            if room not in known:
                sentence = f'there is no room "{room}"; use {listed(known)}'
                raise self.file.wrong(sentence, "worlds", *place)
        return _levels(where)

    def settings(self, count: int, seed: int) -> Iterator[Setting]:
        """Yield the corners (worlds set by hand), then random worlds that cover all pairs of values.

        There are at least `count` worlds, or fewer if not enough different worlds can be found.
        """
        random = Random(f"{self.form.name} {seed}")  # noqa: S311 - not for cryptography
        corners = [self._corner(corner, number) for number, corner in enumerate(self.form.worlds.corners)]
        yield from corners
        seen = {corner.identity for corner in corners}
        left = count - len(corners)
        rows = sample_combinations(self._free, max(1, left), random) if self._free else [{}] * left
        for number, row in enumerate(rows, len(corners) + 1):
            for _ in range(_TRIES):
                chosen = {factor: levels[row.get(factor, 0)] for factor, levels in self.factors.items()}
                rooms = random.sample(self.form.worlds.rooms, len(self.form.worlds.rooms))
                setting = Setting(f"{number}: {self._about(chosen)}", chosen, tuple(rooms))
                if setting.identity not in seen:
                    seen.add(setting.identity)
                    yield setting
                    break

    def _corner(self, corner: CornerFile, number: int) -> Setting:
        chosen = {factor: levels[0] for factor, levels in self.factors.items()}
        for pattern, wanted in corner.set.items():
            level = wanted.option if isinstance(wanted, OptionFile) else wanted
            named = fnmatch.filter(self.factors, pattern)
            anywhere = level in (*self.form.worlds.rooms, IN_NO_ROOM)
            may_be_anywhere = anywhere and (len(named) == 1 or level == IN_NO_ROOM)
            places = [factor for factor in named if may_be_anywhere and factor.endswith(".in")]
            fitting = [factor for factor in named if level in self.factors[factor] or factor in places]
            if not fitting:
                known = ", ".join(self._free)
                sentence = f'no factor that matches "{pattern}" can be "{level}"; the factors are {known}'
                raise self.file.wrong(sentence, "worlds", "corners", number, "set")
            chosen.update(dict.fromkeys(fitting, level))
        return Setting(corner.about, chosen, tuple(self.form.worlds.rooms))

    def _about(self, chosen: Mapping[str, FactorLevel]) -> str:
        parts = []
        for name in (*self.form.worlds.people, *self.form.worlds.things):
            levels, room = self.factors[f"{name}.in"], chosen[f"{name}.in"]
            if room == IN_NO_ROOM:
                parts.append(f"{name} out")
                continue
            details = [f"in {room}"] if sum(level != IN_NO_ROOM for level in levels) > 1 else []
            free = [factor for factor in self._free if factor.startswith(f"{name}.")]
            details += [_detail(factor, chosen[factor]) for factor in free if factor != f"{name}.in"]
            if details or len(levels) > 1:
                parts.append(f"{name} {', '.join(details) or 'in'}")
        if ROBOT_FACTOR in self._free:
            parts.append(f"robot in {chosen[ROBOT_FACTOR]}")
        return "; ".join(parts) or "different order of rooms"

    def world(self, setting: Setting) -> World:
        """Build the world that a setting describes."""
        things = self._things(setting)
        rooms = []
        for room in setting.rooms:
            here = [name for name in self.form.worlds.people if setting.room(name) == room]
            people = tuple(self._person(name, setting) for name in here)
            rooms.append(Room(room, tuple(thing.label for thing in things if thing.room == room), people))
        wait = self.form.worlds.may_wait_forever
        if isinstance(wait, str):
            with self._located("worlds", "may_wait_forever"):
                wait = bool(evaluate(parse_cached(wait), self._names(setting)))
        return World(tuple(rooms), setting.start, setting.about, wait)

    def requirements(self, setting: Setting) -> Iterator[tuple[str, int]]:
        """Yield each requirement of a world as text, with the index of its entry in the list `require`."""
        names = self._names(setting)
        for number, form in enumerate(self.form.require):
            with self._located("require", number):
                yield from ((one, number) for one in _expand(form.check, names))

    def _person(self, name: str, setting: Setting) -> Person:
        form, chosen = self.form.worlds.people[name], setting.chosen
        answers = tuple(chosen[f"{name}.answer {n + 1}"] for n in range(len(form.answers)))
        topics = tuple((topic, chosen[f"{name}.topic {topic}"]) for topic in form.topics)
        return Person(form.name or name, answers, topics, int(chosen[f"{name}.after_looks"]), form.leaves)

    def _things(self, setting: Setting) -> list[SimpleNamespace]:
        things = self.form.worlds.things.items()
        return [SimpleNamespace(name=n, label=form.label or n, room=setting.room(n)) for n, form in things]

    def _names(self, setting: Setting) -> Names:
        people = []
        for name in self.form.worlds.people:
            one = self._person(name, setting)
            answered = {"answers": one.answers, "topics": dict(one.topics), "after_looks": one.after_looks}
            people.append(SimpleNamespace(name=name, room=setting.room(name), **answered))
        names: dict[str, Any] = {"people": people, "things": self._things(setting), "rooms": setting.rooms}
        names["start"] = setting.start
        for name, text in self.form.let.items():
            with self._located("let", name):
                names[name] = evaluate(parse_cached(text), names)
        return names

    @contextmanager
    def _located(self, *place: str | int) -> Iterator[None]:
        try:
            yield
        except ExpressionError as error:
            raise self.file.wrong(str(error), *place) from None


LevelForm: TypeAlias = str | int | OptionFile


def _levels(form: LevelForm | Sequence[LevelForm]) -> tuple[FactorLevel, ...]:
    items: Sequence[LevelForm] = [form] if isinstance(form, str | int | OptionFile) else form
    return tuple(item.option if isinstance(item, OptionFile) else item for item in items)


def _owner(factor: str) -> str:
    return factor.partition(".")[0]


def _detail(factor: str, level: FactorLevel) -> str:
    if ".topic " in factor:
        return f"{first_choice(factor.partition(' ')[2])} {first_choice(str(level))}"
    return f"after looks {level}" if "looks" in factor else first_choice(str(level))


def _expand(text: str, names: Names) -> Iterator[str]:
    """Yield the requirements of an entry: `check(x)`, `... if CONDITION` or `... for NAME in LIST`."""
    match _entry(text):
        case ast.IfExp(test, body, ast.Constant(None)):
            if evaluate(test, names):
                yield _format_call(body, names)
        case ast.GeneratorExp(body, [loop]):
            for each in iterate_loop(loop, names):
                yield _format_call(body, each)
        case _:
            yield _format_call(_entry(text), names)


@cache  # many worlds use the same few entries
def _entry(text: str) -> ast.expr:
    try:
        return parse_cached(f"({text})")
    except ExpressionError:
        with suppress(ExpressionError):
            return parse_cached(f"({text} else None)")
        raise


def _format_call(node: ast.expr, names: Names) -> str:
    match node:
        case ast.UnaryOp(ast.Not(), inner):
            return f"not {_format_call(inner, names)}"
        case ast.Name(name):
            return name
        case ast.Call(ast.Name(name), arguments, []):
            given = [_format_argument(evaluate(argument, names)) for argument in arguments]
            return f"{name}({', '.join(given)})"
    raise ExpressionError(f'"{ast.unparse(node)}" is not a requirement; write check(x) or not check(x)')


def _format_argument(argument: object) -> str:
    if isinstance(argument, str | int) and not isinstance(argument, bool):
        return json.dumps(argument, ensure_ascii=False)
    raise ExpressionError(f"an argument of a check must be a string or a number, not {argument}")
