"""Classifies failures: the paper's classes (section V.B), and replies without a program."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, get_args

from codebotler.core.trace import Outcome, Status
from codebotler.models.no_program import NO_PROGRAM_KINDS, NO_PROGRAM_SENTENCES
from roboeval.evaluation.runs.endings import AGENT_SENTENCES
from roboeval.evaluation.runs.rows import Failure
from roboeval.suites.load import Requirement
from roboeval.suites.schema import Category

NO_PROGRAM_CLASS = "NoProgram"
PYTHON_ERROR_CLASS = "PythonError"
ROBOT_ERROR_CLASS = "RobotExecutionError"
AGENT_ERROR_CLASS = "AgentError"
TASK_ERROR_CLASS = "TaskCompletionError"


@dataclass(frozen=True)
class FailureClass:
    """A class of failures, such as Python errors, with its kinds and its names in tables."""

    name: str  # the name in rows
    label: str  # the name shown to users
    plural: str
    kinds: tuple[str, ...]  # kinds that tables always show; other kinds appear only if they occurred
    is_always_shown: bool = True  # whether tables show the class even if it did not occur


FAILURE_CLASSES: Mapping[str, FailureClass] = {
    one.name: one
    for one in (
        FailureClass(
            NO_PROGRAM_CLASS,
            "no program",
            "without a program",
            NO_PROGRAM_KINDS,
            is_always_shown=False,
        ),
        FailureClass(
            PYTHON_ERROR_CLASS,
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
            ROBOT_ERROR_CLASS,
            "robot error",
            "robot errors",
            (
                "GoToInvalidLocation",
                "PickInvalidObject",
                "PickWhileHolding",
                "PlaceNoObject",
                "AskNoPerson",
                "AskEmptyOptions",
                "AskInvalidOptions",  # not among the paper's six kinds
            ),
        ),
        FailureClass(TASK_ERROR_CLASS, "failed check", "failed checks", get_args(Category)),
        FailureClass(
            AGENT_ERROR_CLASS,
            "mistake of the agent",
            "mistakes of the agent",
            tuple(AGENT_SENTENCES),
            is_always_shown=False,
        ),
    )
}
"""All classes by name. The kind of a failed check is the category of the check."""


def label_of(name: str) -> str:
    """Return the label of a failure class, such as `failed check`, or the `name` itself if it is unknown."""
    return FAILURE_CLASSES[name].label if name in FAILURE_CLASSES else name


def plural_of(name: str) -> str:
    """Return the plural label of a failure class, such as `failed checks`, or the `name` if it is unknown."""
    return FAILURE_CLASSES[name].plural if name in FAILURE_CLASSES else name


def classes_to_show(happened: Collection[str]) -> list[str]:
    """Return the names of the failure classes to show: the paper's three, and any others that `happened`."""
    return [name for name, one in FAILURE_CLASSES.items() if one.is_always_shown or name in happened]


def no_program_sentence(failure: Mapping[str, Any]) -> str | None:
    """Return a sentence that says why a reply contained no program, or None for other classes of failure."""
    if failure["class"] != NO_PROGRAM_CLASS:
        return None
    return next((words for kind, words in NO_PROGRAM_SENTENCES.items() if kind == failure["kind"]), "")


@dataclass(frozen=True)
class Verdict:
    """The judgement on a program in one world: its outcome there, and the requirements that it fails."""

    world: str  # the description of the world
    outcome: Outcome
    failed: tuple[Requirement, ...]  # failed requirements, in the task's order
    satisfied: bool

    def on(self, prompt: int) -> Verdict:
        """Return the verdict for one prompt, which ignores requirements that this prompt does not ask for."""
        asked = tuple(requirement for requirement in self.failed if requirement.is_asked_by(prompt))
        if len(asked) == len(self.failed):
            return self
        return replace(self, failed=asked, satisfied=not asked)


def failure_of_verdicts(verdicts: Sequence[Verdict]) -> Failure | None:
    """Return the failure of a completion in its first unsatisfied world, or None if it passes.

    The failure is the first failed check in that world, or else the error there. Checks do not count after an
    error, except after a timeout in a world where programs may wait forever.
    """
    for index, verdict in enumerate(verdicts):
        if not verdict.satisfied:
            error = verdict.outcome.error
            if verdict.failed:
                first = verdict.failed[0]
                kind, check = first.category, first.text
                return {"class": TASK_ERROR_CLASS, "kind": kind, "world": index, "check": check}
            assert error is not None, "a world with neither an error nor a failed check is satisfied"
            name = _class_of(verdict.outcome.status, error.kind)
            return {"class": name, "kind": error.kind, "world": index, "check": None}
    return None


def _class_of(status: Status, kind: str) -> str:
    if status is Status.ROBOT_ERROR:
        return ROBOT_ERROR_CLASS
    is_limit_of_agent = status is Status.TIMEOUT and kind in AGENT_SENTENCES
    return AGENT_ERROR_CLASS if status is Status.AGENT_ERROR or is_limit_of_agent else PYTHON_ERROR_CLASS
