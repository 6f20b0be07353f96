"""Defines mutation operators, and collects the information about a task that they use."""

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
    """The task data for operators: its prompts, and the names of rooms, people and things in its worlds."""

    rooms: tuple[str, ...]  # without the rooms where the robot starts
    people: tuple[str, ...]  # owners of rooms, the only people named in instructions
    things: tuple[str, ...]
    prompts: tuple[str, ...]

    @classmethod
    def of(cls, worlds: Sequence[World], prompts: Sequence[str] = ()) -> Context:
        """Collect the names of rooms, people and things from a task's worlds, and keep its prompts."""
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
        """Return the rooms that a program never mentions: no string contains a word of their names."""
        texts = filter(None, map(text_of, program.nodes))
        named = {word for text in texts for word in re.findall(r"\w+", text.lower())}
        return tuple(room for room in self.rooms if not named & set(re.findall(r"\w+", room.lower())))


Edits: TypeAlias = Iterator[Edit]
Mutate: TypeAlias = Callable[[ProgramTree, Context], Edits]
Condition: TypeAlias = Callable[[Context], bool]


@dataclass(frozen=True)
class Operator:
    """A mutation operator, which introduces one kind of mistake into programs, such as a missing drive."""

    name: str  # such as `drop-the-return`
    about: str
    edits: Mutate  # yields one edit for each mutant


def operators_in(module: ModuleType) -> Iterator[Operator]:
    """Yield an operator for each public function of a module, described by the function's docstring."""
    for name, function in vars(module).items():
        if isfunction(function) and function.__module__ == module.__name__ and not name.startswith("_"):
            about = (function.__doc__ or "").removeprefix("Yield each edit that ").capitalize()
            yield Operator(name.replace("_", "-"), about, function)


def only_if(condition: Condition) -> Callable[[Mutate], Mutate]:
    """Return a decorator that makes an operator yield no edits for tasks that do not meet a condition."""

    def conditional(edits: Mutate) -> Mutate:
        @wraps(edits)
        def only(program: ProgramTree, context: Context) -> Edits:
            return edits(program, context) if condition(context) else iter(())

        return only

    return conditional


def prompt_matches(pattern: str) -> Condition:
    """Return a condition for `only_if`: whether a regex matches any prompt, or the task has no prompts."""
    compiled = re.compile(pattern)
    return lambda context: not context.prompts or any(map(compiled.search, context.prompts))


def next_names(names: Sequence[str], name: str, most: int = 2) -> tuple[str, ...]:
    """Return up to `most` names that follow a name in a cycle: `c` and `a` follow `b` in `a, b, c`."""
    folded = [one.lower() for one in names]
    at = folded.index(name.lower()) if name.lower() in folded else -1
    around = [*names[at + 1 :], *names[: max(at, 0)]]
    return tuple(one for one in around if one.lower() != name.lower())[:most]
