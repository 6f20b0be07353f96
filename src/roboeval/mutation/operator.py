"""What a mutation operator is, and what it may know of the worlds."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from codebotler.world import World
from roboeval.mutation.rewriting import Edit, Source


@dataclass(frozen=True)
class Setting:
    """The names that there are in the worlds of a task, in the order in which they first stand there.

    Args:
        rooms: all rooms but the start.
        people: who has a room of their own; of the others no instruction tells the name.
        things: what lies somewhere.
    """

    rooms: tuple[str, ...]
    people: tuple[str, ...]
    things: tuple[str, ...]

    @classmethod
    def of(cls, worlds: Sequence[World]) -> Setting:
        """The setting of some worlds."""
        starts = {world.robot for world in worlds}
        rooms = [room for world in worlds for room in world.rooms]
        owners = (re.fullmatch(r"(\w+)'s .+", room.name) for room in rooms)
        return cls(
            tuple(dict.fromkeys(room.name for room in rooms if room.name not in starts)),
            tuple(dict.fromkeys(owner[1] for owner in owners if owner)),
            tuple(dict.fromkeys(thing for room in rooms for thing in room.objects)),
        )

    def idle_rooms(self, source: Source) -> tuple[str, ...]:
        """The rooms of whose names no word stands in any text of a program."""
        told = {word for text in source.texts for word in re.findall(r"\w+", text)}
        return tuple(room for room in self.rooms if not told & set(re.findall(r"\w+", room.lower())))


Edits: TypeAlias = Callable[[Source, Setting], Iterable[Edit]]


@dataclass(frozen=True)
class Operator:
    """One way in which models get a program wrong.

    Args:
        name: such as `drop-the-return`.
        about: what the mutant does wrong, in a sentence.
        edits: all ways to make a program wrong like that, each by itself.
    """

    name: str
    about: str
    edits: Edits

    def __call__(self, source: Source, setting: Setting) -> Iterator[Edit]:
        """The edits of a program."""
        yield from self.edits(source, setting)


def others(names: Sequence[str], name: str, most: int = 2) -> tuple[str, ...]:
    """The names that come after a name, round and round, without it."""
    folded = [one.lower() for one in names]
    at = folded.index(name.lower()) if name.lower() in folded else -1
    around = [*names[at + 1 :], *names[: max(at, 0)]]
    return tuple(one for one in around if one.lower() != name.lower())[:most]
