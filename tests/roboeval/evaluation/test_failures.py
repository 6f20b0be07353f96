import pytest

from codebotler.core.trace import Outcome, RunError, Status
from codebotler.rtl import parse
from roboeval.evaluation.judging.failures import FAILURE_CLASSES, Verdict, failure_of_verdicts
from roboeval.evaluation.runs.rows import Failure
from roboeval.suites.load import Requirement
from roboeval.suites.schema import Category

FORMULA = parse('tr.Exists(say("x"))')


def required(text: str, category: Category) -> Requirement:
    return Requirement(text, text, FORMULA, category)


def finished(*failed: Requirement) -> Verdict:
    return Verdict("w", Outcome(Status.FINISHED, ()), failed, satisfied=not failed)


def ended(status: Status, kind: str, *failed: Requirement) -> Verdict:
    return Verdict("w", Outcome(status, (), RunError(kind, "m")), failed, satisfied=False)


def failed(name: str, kind: str, world: int, check: str | None = None) -> Failure:
    return {"class": name, "kind": kind, "world": world, "check": check}


A, B = required("a", "SayAtLocation"), required("b", "Location")


@pytest.mark.parametrize(
    ("verdicts", "expected"),
    [
        ([finished(), finished()], None),
        ([finished(), finished(A, B)], failed("TaskCompletionError", "SayAtLocation", 1, "a")),
        ([finished(B, A), finished(A)], failed("TaskCompletionError", "Location", 0, "b")),
        (
            [ended(Status.ROBOT_ERROR, "AskNoPerson"), finished(A)],
            failed("RobotExecutionError", "AskNoPerson", 0),
        ),
        ([ended(Status.PYTHON_ERROR, "KeyError")], failed("PythonError", "KeyError", 0)),
        ([ended(Status.TIMEOUT, "TimeoutError")], failed("PythonError", "TimeoutError", 0)),
        ([ended(Status.KILLED, "MemoryError")], failed("PythonError", "MemoryError", 0)),
        (
            [ended(Status.TIMEOUT, "TimeoutError", B)],  # in a world that may wait for ever
            failed("TaskCompletionError", "Location", 0, "b"),
        ),
    ],
)
def test_the_first_unsatisfied_world_gives_the_one_reason(
    verdicts: list[Verdict], expected: Failure | None
) -> None:
    assert failure_of_verdicts(verdicts) == expected


def test_the_kinds_of_the_paper_are_always_there() -> None:
    assert [len(one.kinds) for one in FAILURE_CLASSES.values()] == [6, 9, 7, 8, 10]
