"""Mutation operators, and the context of a task that they use."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import wraps
from inspect import isfunction
from types import ModuleType
from typing import TypeAlias

from codebotler.core.world import World
from roboeval.mutation.program_tree import Edit, ProgramTree, text_of


@dataclass(frozen=True)
class Context:
    """The names in the worlds of a task, and its prompts."""

    rooms: tuple[str, ...]  # except starting rooms
    people: tuple[str, ...]  # owners of rooms; instructions name no other people
    things: tuple[str, ...]
    prompts: tuple[str, ...]

    @classmethod
    def of(cls, worlds: Sequence[World], prompts: Sequence[str] = ()) -> Context:
        """Collect the context of a task."""
        starts = {world.robot for world in worlds}
        rooms = [room for world in worlds for room in world.rooms]
        owners = (re.fullmatch(r"(\w+)'s .+", room.name) for room in rooms)
        return cls(
            tuple(dict.fromkeys(room.name for room in rooms if room.name not in starts)),
            tuple(dict.fromkeys(owner[1] for owner in owners if owner)),
            tuple(dict.fromkeys(thing for room in rooms for thing in room.objects)),
            tuple(prompts),
        )

    def idle_rooms(self, program: ProgramTree) -> tuple[str, ...]:
        """The rooms whose names share no word with the strings of a program."""
        texts = filter(None, map(text_of, program.nodes))
        named = {word for text in texts for word in re.findall(r"\w+", text.lower())}
        return tuple(room for room in self.rooms if not named & set(re.findall(r"\w+", room.lower())))


Edits: TypeAlias = Iterator[Edit]
Mutate: TypeAlias = Callable[[ProgramTree, Context], Edits]
Condition: TypeAlias = Callable[[Context], bool]


@dataclass(frozen=True)
class Operator:
    """A mutation operator: a mistake that models make in programs."""

    name: str  # such as `drop-the-return`
    about: str
    edits: Mutate  # each edit makes one mutant


def operators_in(module: ModuleType) -> Iterator[Operator]:
    """The operators of a module: its public functions."""
    for name, function in vars(module).items():
        if isfunction(function) and function.__module__ == module.__name__ and not name.startswith("_"):
            yield Operator(name.replace("_", "-"), function.__doc__ or "", function)


def only_if(condition: Condition) -> Callable[[Mutate], Mutate]:
    """Restrict an operator to tasks that meet a condition, since others do not require what it changes."""

    def conditional(edits: Mutate) -> Mutate:
        @wraps(edits)
        def only(program: ProgramTree, context: Context) -> Edits:
            return edits(program, context) if condition(context) else iter(())

        return only

    return conditional


def prompt_matches(pattern: str) -> Condition:
    """The condition that a prompt matches, since a program may omit what no prompt asks for."""
    compiled = re.compile(pattern)
    return lambda context: not context.prompts or any(map(compiled.search, context.prompts))


def next_names(names: Sequence[str], name: str, most: int = 2) -> tuple[str, ...]:
    """The names that follow a name in a cyclic list."""
    folded = [one.lower() for one in names]
    at = folded.index(name.lower()) if name.lower() in folded else -1
    around = [*names[at + 1 :], *names[: max(at, 0)]]
    return tuple(one for one in around if one.lower() != name.lower())[:most]
