"""What a mutation operator is, and what it may know of the worlds."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from codebotler.world import World
from roboeval.mutation.rewriting import Edit, Source

COMING_BACK = re.compile(
    r"\b(come|came|coming|are) back\b|\bback (here|with me|to me)\b|\breturn (here|to me|to where)\b"
)
TELLING = re.compile(r"\b(tell|say|speak|report|inform|hear|know|announce|suggest)\b")
STAYING_OUT = re.compile(
    r"\b(no other room|nowhere else|no place besides|(other|remaining) rooms|just the labs|straight|directly)"
)
BRINGING_HERE = re.compile(
    r"\b(bring|fetch|carry|take|have|come back)\b[^.:;]*\b(here|to me|with me|with it)\b", re.IGNORECASE
)
PUTTING_DOWN = re.compile(
    r"\b((put|set|lay|leav)(e|ting|ing)? (it|them|that) (down|here|there)|put down)\b", re.IGNORECASE
)


@dataclass(frozen=True)
class Setting:
    """What operators may know of a task: the names in its worlds, in their order there, and its instruction.

    Args:
        rooms: all rooms but the start.
        people: who has a room of their own; of the others no instruction tells the name.
        things: what lies somewhere.
        phrasings: of the instruction.
    """

    rooms: tuple[str, ...]
    people: tuple[str, ...]
    things: tuple[str, ...]
    phrasings: tuple[str, ...] = ()

    @classmethod
    def of(cls, worlds: Sequence[World], phrasings: Sequence[str] = ()) -> Setting:
        """The setting of some worlds and of an instruction."""
        starts = {world.robot for world in worlds}
        rooms = [room for world in worlds for room in world.rooms]
        owners = (re.fullmatch(r"(\w+)'s .+", room.name) for room in rooms)
        return cls(
            tuple(dict.fromkeys(room.name for room in rooms if room.name not in starts)),
            tuple(dict.fromkeys(owner[1] for owner in owners if owner)),
            tuple(dict.fromkeys(thing for room in rooms for thing in room.objects)),
            tuple(phrasings),
        )

    def asks_for(self, what: re.Pattern[str]) -> bool:
        """Whether some phrasing asks for it; what none asks for, a program may leave out."""
        return not self.phrasings or any(what.search(phrasing) for phrasing in self.phrasings)

    @property
    def may_be_held(self) -> bool:
        """Whether some phrasing is content with what is brought back and still held."""
        return any(BRINGING_HERE.search(one) and not PUTTING_DOWN.search(one) for one in self.phrasings)

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


def where(what: re.Pattern[str], edits: Edits) -> Edits:
    """Edits of programs for those instructions only that ask for it."""

    def only(source: Source, setting: Setting) -> Iterable[Edit]:
        return edits(source, setting) if setting.asks_for(what) else ()

    return only


def where_put_down(edits: Edits) -> Edits:
    """Edits of programs for those instructions only that are not content with what is held."""

    def only(source: Source, setting: Setting) -> Iterable[Edit]:
        return () if setting.may_be_held else edits(source, setting)

    return only


def others(names: Sequence[str], name: str, most: int = 2) -> tuple[str, ...]:
    """The names that come after a name, round and round, without it."""
    folded = [one.lower() for one in names]
    at = folded.index(name.lower()) if name.lower() in folded else -1
    around = [*names[at + 1 :], *names[: max(at, 0)]]
    return tuple(one for one in around if one.lower() != name.lower())[:most]
