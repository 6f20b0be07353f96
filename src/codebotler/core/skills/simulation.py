"""The interface through which the functions of skills act on a simulated robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NoReturn, Protocol


class Simulation(Protocol):
    """A robot in a simulated world, whose operations raise a RobotError if they fail."""

    @property
    def room(self) -> str:
        """The robot's current room."""

    @property
    def rooms(self) -> Sequence[str]:
        """All rooms."""

    def drive(self, location: str) -> None:
        """Drive to the room that a request refers to."""

    def look(self, entity: str) -> bool:
        """Return whether an object or a person is in the robot's room."""

    def ask(self, person: str, question: str, options: Sequence[Any]) -> Any:  # noqa: ANN401 - an option, or its number
        """Ask a person in the robot's room, and return the option that they choose."""

    def take(self, obj: str) -> None:
        """Pick up an object in the robot's room."""

    def put(self, obj: str) -> None:
        """Put down the object that the robot holds."""

    def record(self, kind: str, text: str) -> None:
        """Record an event at the current place and time."""

    @property
    def state(self) -> dict[str, Any]:
        """The data that skills keep between the calls of a run."""

    def outcome(self, skill: str, arguments: Sequence[Any]) -> Any:  # noqa: ANN401 - the skill's type
        """Return a random result for a skill with an empty body, or raise one of its errors."""

    def things(self, where: str = "", is_: str = "") -> list[str]:
        """Return the names of the things in a room or at a place, or anywhere, that fit a description."""

    def people(self, where: str = "", is_: str = "", **traits: str) -> list[str]:
        """Return the names of the people in a room, or anywhere, who fit a description."""

    def traits(self, name: str) -> Mapping[str, Any]:
        """Return the properties that the world gives to a thing or person."""

    def move_person(self, name: str, room: str) -> None:
        """Move a person to a room or place."""

    def value(self, statement: str, *values: Any) -> Any:  # noqa: ANN401 - any type
        """Return the value of a statement in this world: from `truths` in its file, or one at random."""

    def truth(self, statement: str) -> bool:
        """Return whether a statement is true in this world: as `truths` in its file says, or at random."""

    def fail(self, kind: str) -> NoReturn:
        """Raise an error that the skill declares under `fails`."""
