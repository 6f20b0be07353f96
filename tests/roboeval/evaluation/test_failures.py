import pytest

from codebotler.core.trace import Outcome, RunError, Status
from codebotler.rtl import parse
from roboeval.evaluation.judging.failures import FAILURE_CLASSES, Verdict, failure_of_verdicts
from roboeval.evaluation.runs.rows import Failure
from roboeval.suites.load import Requirement
from roboeval.suites.schema import Category

FORMULA = parse('tr.Exists(say("x"))')


def requirement(text: str, category: Category) -> Requirement:
    return Requirement(text, text, FORMULA, category)


def verdict(*failed: Requirement) -> Verdict:
    return Verdict("w", Outcome(Status.FINISHED, ()), failed, satisfied=not failed)


def error(status: Status, kind: str, *failed: Requirement) -> Verdict:
    return Verdict("w", Outcome(status, (), RunError(kind, "m")), failed, satisfied=False)


def failure(name: str, kind: str, world: int, check: str | None = None) -> Failure:
    return {"class": name, "kind": kind, "world": world, "check": check}


A, B = requirement("a", "SayAtLocation"), requirement("b", "Location")


@pytest.mark.parametrize(
    ("verdicts", "expected"),
    [
        ([verdict(), verdict()], None),
        ([verdict(), verdict(A, B)], failure("TaskCompletionError", "SayAtLocation", 1, "a")),
        ([verdict(B, A), verdict(A)], failure("TaskCompletionError", "Location", 0, "b")),
        (
            [error(Status.ROBOT_ERROR, "AskNoPerson"), verdict(A)],
            failure("RobotExecutionError", "AskNoPerson", 0),
        ),
        ([error(Status.PYTHON_ERROR, "KeyError")], failure("PythonError", "KeyError", 0)),
        ([error(Status.TIMEOUT, "TimeoutError")], failure("PythonError", "TimeoutError", 0)),
        ([error(Status.KILLED, "MemoryError")], failure("PythonError", "MemoryError", 0)),
        (
            [error(Status.TIMEOUT, "TimeoutError", B)],  # This world may wait forever.
            failure("TaskCompletionError", "Location", 0, "b"),
        ),
    ],
)
def test_the_first_unsatisfied_world_gives_the_reason(
    verdicts: list[Verdict], expected: Failure | None
) -> None:
    assert failure_of_verdicts(verdicts) == expected


def test_failure_classes_have_the_kinds_of_the_paper() -> None:
    assert set(FAILURE_CLASSES["PythonError"].kinds) == {
        *("SyntaxError", "NameError", "TypeError", "AttributeError", "ValueError", "KeyError"),
        *("IndexError", "TimeoutError", "UnboundLocalError"),
    }
    assert set(FAILURE_CLASSES["RobotExecutionError"].kinds) == {
        *("GoToInvalidLocation", "PickInvalidObject", "PickWhileHolding", "PlaceNoObject", "AskNoPerson"),
        *("AskEmptyOptions", "AskInvalidOptions"),
    }
    assert set(FAILURE_CLASSES["TaskCompletionError"].kinds) == {
        *("SayAtLocation", "AskAtLocation", "ManipulationAtLocation", "CheckEntityAtLocation"),
        *("InitialTerminal", "EventOrdering", "Location", "ExhaustiveSearch"),
    }
