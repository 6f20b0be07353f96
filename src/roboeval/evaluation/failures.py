"""Why completions fail: the paper's three classes and their kinds (section V.B)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, get_args

from codebotler.trace import Outcome, Status
from roboeval.suites.load import Requirement
from roboeval.suites.schema import Category

PYTHON, ROBOT, TASK = "PythonError", "RobotExecutionError", "TaskCompletionError"
CLASSES = (PYTHON, ROBOT, TASK)

PYTHON_KINDS = (
    "SyntaxError",
    "NameError",
    "TypeError",
    "AttributeError",
    "ValueError",
    "KeyError",
    "IndexError",
    "TimeoutError",
    "UnboundLocalError",
)
"""The kinds that are always shown; others appear as they come."""

ROBOT_KINDS = (
    "GoToInvalidLocation",
    "PickInvalidObject",
    "PickWhileHolding",
    "PlaceNoObject",
    "AskNoPerson",
    "AskEmptyOptions",
    "AskInvalidOptions",
)
"""The paper's six and AskInvalidOptions."""

CATEGORIES: tuple[Category, ...] = get_args(Category)
"""The classes of checks; a failed check's category is the kind of a TaskCompletionError."""


@dataclass(frozen=True)
class Verdict:
    """How a program did in one world.

    Args:
        world: what the world is about.
        outcome: how the run ended.
        failed: the requirements that do not hold, in the task's order.
        satisfied: whether it did what was asked.
    """

    world: str
    outcome: Outcome
    failed: tuple[Requirement, ...]
    satisfied: bool


@dataclass(frozen=True)
class Failure:
    """The one reason for which a completion fails.

    Args:
        failure_class: one of the three classes.
        kind: the kind within it.
        world: position of the first unsatisfied world, counted from 0.
        check: the first failed requirement there; None where an error decided.
    """

    failure_class: str
    kind: str
    world: int
    check: str | None = None

    def data(self) -> dict[str, Any]:
        """As a row of an evaluation writes it."""
        return {
            "class": self.failure_class,
            "kind": self.kind,
            "world": self.world,
            "check": self.check,
        }


def failure(verdicts: Sequence[Verdict]) -> Failure | None:
    """The failure of a completion: the first unsatisfied world decides; None if all are satisfied.

    Within that world the error decides, else the first failed check. Where a world may wait for ever,
    reaching a limit is no error, so there the checks decide.
    """
    for index, verdict in enumerate(verdicts):
        if not verdict.satisfied:
            error = verdict.outcome.error
            if verdict.failed:
                first = verdict.failed[0]
                return Failure(TASK, first.category, index, first.text)
            if error is None:
                raise ValueError("a world without error and failed checks is satisfied")
            is_robots = verdict.outcome.status is Status.ROBOT_ERROR
            return Failure(ROBOT if is_robots else PYTHON, error.kind, index)
    return None
