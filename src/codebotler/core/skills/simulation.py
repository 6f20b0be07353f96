"""The interface through which the functions of skills act on a simulated robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NoReturn, Protocol


class Simulation(Protocol):
    """A simulated robot, for the functions of skills. A method raises RobotError if its action fails."""

    @property
    def room(self) -> str:
        """The name of the robot's current room."""

    @property
    def rooms(self) -> Sequence[str]:
        """The names of all rooms."""

    def drive(self, location: str) -> None:
        """Drive to the room whose name fits `location`."""

    def look(self, entity: str) -> bool:
        """Return whether an object or a person is in the robot's room."""

    def ask(self, person: str, question: str, options: Sequence[Any]) -> Any:  # noqa: ANN401 - an int, but `ask` declares str
        """Ask a person in the robot's room, and return the position, from 0, of the option they choose."""

    def take(self, obj: str) -> None:
        """Pick up an object in the robot's room."""

    def put(self, obj: str) -> None:
        """Put down the object that the robot holds."""

    def record(self, kind: str, text: str) -> None:
        """Add an event to the trace, such as `record("say", "hello")`, at the current place and time."""

    @property
    def state(self) -> dict[str, Any]:
        """A dictionary in which skills keep data during a run, such as which doors are open."""

    def outcome(self, skill: str, arguments: Sequence[Any]) -> Any:  # noqa: ANN401 - the skill's type
        """Return the result of a skill with an empty body, from `truths` or at random, or raise its error."""

    def things(self, where: str = "", is_: str = "") -> list[str]:
        """Return the names of all things, or of some: `things("kitchen", "fruit")` for fruit in a kitchen."""

    def people(self, where: str = "", is_: str = "", **traits: str) -> list[str]:
        """Return the names of all people, or of some: `people("lobby", "doctor", wears="red coat")`."""

    def traits(self, name: str) -> Mapping[str, Any]:
        """Return the properties of a thing or person, such as `{"wears": "red coat"}`."""

    def move_person(self, name: str, room: str) -> None:
        """Move a person to a room or place."""

    def value(self, statement: str, *values: Any) -> Any:  # noqa: ANN401 - any type
        """Return a statement's value from `truths` in the world's file, or else one of `values` at random."""

    def truth(self, statement: str) -> bool:
        """Return whether a statement is true in this world: as `truths` in its file says, or at random."""

    def fail(self, kind: str) -> NoReturn:
        """Raise the RobotError of a kind that the skill declares under `fails`, such as `DoorLocked`."""
