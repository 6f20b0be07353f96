"""Exceptions survive pickling, so that they can reach the caller from another process."""

import pickle
import re
from functools import cache
from http import HTTPStatus
from importlib import import_module
from pathlib import Path

import pytest

from codebotler.core.trace import Event, Option
from codebotler.rtl import parse
from codebotler.simulator.guard.house_rule import Rule

SOURCES = Path(__file__).parent.parent / "src"
BASES = {"Exception", "ValueError", "RuntimeError", "UserError", "RobotError"}
# Another Python runs these modules, and their exceptions stay there.
OTHER_PYTHON_MODULES = {"codebotler.robots.ros.workers.channel", "codebotler.simulator.sandbox.execution"}
A_SENTENCE = ("a sentence",)
ARGUMENTS: dict[str, tuple[tuple[object, ...], dict[str, object]]] = {
    "codebotler.core.errors.UserError": (("is wrong " * 66,), {"file": Path("a/task.yaml"), "line": 3}),
    "codebotler.models.base.BudgetSpentError": ((1_000, 1_012), {}),
    "codebotler.models.base.ModelError": (A_SENTENCE, {"is_temporary": True, "retry_after": 2.5}),
    "codebotler.rtl.semantics.Inconclusive": ((4, 1, Option("3", is_text=False)), {}),
    "codebotler.rtl.source.RtlSyntaxError": ((3, "a bracket is missing"), {}),
    "codebotler.core.errors.RobotError": (("PickInvalidObject", "there is no mug"), {}),
    "codebotler.simulator.process.isolated_call.IsolatedCallError": (("MemoryError", "it is too large"), {}),
    "codebotler.simulator.guard.house_rule.RuleViolationError": (
        (Rule("quiet", "Be quiet.", parse('not tr.Exists(say(".*"))')), Event("say", "hello")),
        {"objection": "is broken by"},
    ),
    "codebotler.web.security.guard.RefusedError": ((HTTPStatus.FORBIDDEN, "a sentence"), {}),
}
"""Arguments of each exception, positional and by name; one sentence by default."""


CLASS = re.compile(r"^class ([A-Za-z]\w*)\(([^)]*)\):", re.MULTILINE)


@cache
def exceptions() -> list[str]:
    """Return the names of all public exceptions of our modules."""
    found = []
    for path in sorted(SOURCES.rglob("*.py")):
        module = ".".join(path.relative_to(SOURCES).with_suffix("").parts)
        if module not in OTHER_PYTHON_MODULES:
            classes = CLASS.findall(path.read_text())
            found += [f"{module}.{name}" for name, bases in classes if BASES & {*re.split(r"\W+", bases)}]
    return found


def test_search_finds_exceptions() -> None:
    assert {
        *ARGUMENTS,
        "codebotler.simulator.process.errors.EngineError",
        "codebotler.missions.mission.MissionError",
    } <= {*exceptions()}


@pytest.mark.parametrize("name", exceptions())
def test_exception_survives_pickling(name: str) -> None:
    module, _, kind = name.rpartition(".")
    given, named = ARGUMENTS.get(name, (A_SENTENCE, {}))
    error = getattr(import_module(module), kind)(*given, **named)
    error.add_note("a note")
    for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
        again = pickle.loads(pickle.dumps(error, protocol))
        assert type(again) is type(error)
        assert (str(again), again.args, vars(again)) == (str(error), error.args, vars(error))
