"""Why completions fail: no program, or one of the classes of the paper (section V.B), each with kinds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import get_args

from codebotler.core.trace import Outcome, Status
from codebotler.models.no_program import NO_PROGRAM_KINDS
from roboeval.evaluation.runs.rows import Failure
from roboeval.suites.load import Requirement
from roboeval.suites.schema import Category

NO_PROGRAM = "NoProgram"
PYTHON, ROBOT, TASK = "PythonError", "RobotExecutionError", "TaskCompletionError"


@dataclass(frozen=True)
class FailureClass:
    """A class of failures."""

    name: str  # in rows
    label: str  # for people
    plural: str
    kinds: tuple[str, ...]  # those that tables always show; others appear as they come


CLASSES: Mapping[str, FailureClass] = {
    one.name: one
    for one in (
        FailureClass(NO_PROGRAM, "no program", "without a program", NO_PROGRAM_KINDS),
        FailureClass(
            PYTHON,
            "Python error",
            "Python errors",
            (
                "SyntaxError",
                "NameError",
                "TypeError",
                "AttributeError",
                "ValueError",
                "KeyError",
                "IndexError",
                "TimeoutError",
                "UnboundLocalError",
            ),
        ),
        FailureClass(
            ROBOT,
            "robot error",
            "robot errors",
            (
                "GoToInvalidLocation",
                "PickInvalidObject",
                "PickWhileHolding",
                "PlaceNoObject",
                "AskNoPerson",
                "AskEmptyOptions",
                "AskInvalidOptions",  # beyond the paper's six
            ),
        ),
        FailureClass(TASK, "failed check", "failed checks", get_args(Category)),
    )
}
"""All classes; the kind of a failed check is the check's category. `failure` assigns them."""


def label_of(name: str) -> str:
    """The label of a class; of an unknown one its name."""
    return CLASSES[name].label if name in CLASSES else name


def plural_of(name: str) -> str:
    """The plural label of a class; of an unknown one its name."""
    return CLASSES[name].plural if name in CLASSES else name


@dataclass(frozen=True)
class Verdict:
    """How a program did in one world."""

    world: str  # what the world is about
    outcome: Outcome
    failed: tuple[Requirement, ...]  # in the task's order
    satisfied: bool

    def on(self, prompt: int) -> Verdict:
        """The verdict on the program as one that was written for a prompt."""
        asked = tuple(requirement for requirement in self.failed if requirement.is_asked_by(prompt))
        if len(asked) == len(self.failed):
            return self
        return replace(self, failed=asked, satisfied=not asked)


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
            assert error is not None, "a world without error and failed checks is satisfied"
            is_robots = verdict.outcome.status is Status.ROBOT_ERROR
            return Failure(ROBOT if is_robots else PYTHON, error.kind, index)
    return None
