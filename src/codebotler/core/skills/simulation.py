"""The interface of a simulated robot for functions of skills."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NoReturn, Protocol


class Simulation(Protocol):
    """A robot in a simulated world; operations fail with a RobotError."""

    @property
    def room(self) -> str:
        """The robot's current room."""

    @property
    def rooms(self) -> Sequence[str]:
        """All rooms."""

    def drive(self, location: str) -> None:
        """Drive to the room that a request means."""

    def look(self, entity: str) -> bool:
        """Look whether an object or a person is here."""

    def ask(self, person: str, question: str, options: Sequence[Any]) -> Any:  # noqa: ANN401 - an option, or its number
        """Ask a person here, who chooses one of the options."""

    def take(self, obj: str) -> None:
        """Pick up an object here."""

    def put(self, obj: str) -> None:
        """Put down the object that the robot holds."""

    def record(self, kind: str, text: str) -> None:
        """Add an event at the current place and time."""

    @property
    def state(self) -> dict[str, Any]:
        """Data that skills keep between calls; empty at the start of a run."""

    def outcome(self, skill: str, arguments: Sequence[Any]) -> Any:  # noqa: ANN401 - of the skill's type
        """Return a random result of a skill without code, or raise one of its errors."""

    def truth(self, statement: str) -> bool:
        """Whether a statement is true in this world: by `truths` in its file, or at random."""

    def fail(self, kind: str) -> NoReturn:
        """Fail with an error that the skill declares under `fails`."""
