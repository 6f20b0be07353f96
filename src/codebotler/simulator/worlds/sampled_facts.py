"""The facts of a sampled world, and what a program has found out about its rooms."""

from __future__ import annotations

from dataclasses import dataclass, field

from codebotler.core.text.words import brief
from codebotler.simulator.worlds.matching import SOMEBODY, contains

PRESENT_FORM, ABSENT_FORM = '"{}" is in "{}"', '"{}" is not in "{}"'
ANSWER_FORM = 'the answer in "{}" to "{}" is "{}"'


@dataclass(frozen=True)
class SampledFact:
    """A fact of a sampled world, such as `"mug" is in "hall"`.

    Args:
        form: the fact in words, such as `"{}" is in "{}"`, with `{}` for each name or text.
        names: the names and texts for each `{}`.
        is_random: False if the fact was not chosen at random, but is true because the program assumed it.
    """

    form: str
    names: tuple[str, ...]
    is_random: bool = True

    @property
    def sentence(self) -> str:
        """The fact in words, such as `"mug" is in "hall"`. In names, double quotes become single ones."""
        names = map(brief, self.names)
        return self.form.format(*(name.replace('"', "'") if '"' in self.form else name for name in names))


def whereabouts(
    name: str, room: str, since: str = "", *, is_there: bool, is_random: bool = True
) -> SampledFact:
    """Return the fact that a person or thing is in a room, or not, after the words `since`.

    `name` must be `normalized`.
    """
    if name == SOMEBODY:
        return SampledFact(f'{since}{SOMEBODY if is_there else "nobody"} is in "{{}}"', (room,), is_random)
    return SampledFact(since + (PRESENT_FORM if is_there else ABSENT_FORM), (name, room), is_random)


# --- the program's knowledge, by canonical names


@dataclass
class ExploredRoom:
    """The facts about one room that a program knows. All names have the form that `normalized` returns."""

    missed: set[str] = field(default_factory=set)  # looked for and not found
    gone: set[str] = field(default_factory=set)  # picked up here
    people: set[str] = field(default_factory=set)

    def lacks(self, name: str) -> bool:
        """Return whether a name is known to be absent. If there is no "red mug", there is no "mug" either."""
        missed = self.missed
        return name in missed or (name != SOMEBODY and any(contains(longer, name) for longer in missed))


@dataclass
class RoomSearch:
    """The rooms in which a program looked for a person or thing: those without it and those with it."""

    rooms_without: set[str] = field(default_factory=set)
    rooms_with: set[str] = field(default_factory=set)

    @property
    def is_lost(self) -> bool:
        """Whether the program searched at least two rooms, and found the person or thing in none."""
        return len(self.rooms_without) > 1 and not self.rooms_with
