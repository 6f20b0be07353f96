"""The operations that functions of skills have on a robot in a simulated world."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NoReturn, Protocol


class Simulation(Protocol):
    """A robot in a simulated world, as functions of skills see it; each failure is a RobotError."""

    @property
    def room(self) -> str:
        """The room that the robot is in."""

    @property
    def rooms(self) -> Sequence[str]:
        """All rooms."""

    def drive(self, location: str) -> None:
        """Go to the room that a request means."""

    def look(self, entity: str) -> bool:
        """Whether an object or a person is here."""

    def ask(self, person: str, question: str, options: Sequence[Any]) -> Any:  # noqa: ANN401 - an option, or its number
        """Ask a person here, who chooses one of the options."""

    def take(self, obj: str) -> None:
        """Pick up an object that is here."""

    def put(self, obj: str) -> None:
        """Put down what the robot holds."""

    def record(self, kind: str, text: str) -> None:
        """Add an event that happens here and now."""

    @property
    def state(self) -> dict[str, Any]:
        """What skills remember from one call to the next; empty when a run begins."""

    def outcome(self, skill: str, arguments: Sequence[Any]) -> Any:  # noqa: ANN401 - of the skill's type
        """A random result of a skill without code: a value of its type, or one of its errors."""

    def truth(self, statement: str) -> bool:
        """Whether a statement is true in this world: as its file says under `truths`, or else at random."""

    def fail(self, kind: str) -> NoReturn:
        """End the skill with an error that it declares under `fails`."""
