"""Exceptions reach whoever asked, also from another process."""

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
ROOTS = {"Exception", "ValueError", "RuntimeError", "UserError", "RobotError"}
WITHIN = {
    "codebotler.robots.ros.workers.channel",
    "codebotler.simulator.sandbox.execution",
}  # of another Python
A_SENTENCE = ("a sentence",)
MADE_OF: dict[str, tuple[tuple[object, ...], dict[str, object]]] = {
    "codebotler.core.errors.UserError": (("is wrong " * 66,), {"file": Path("a/task.yaml"), "line": 3}),
    "codebotler.models.base.BudgetSpentError": ((1_000, 1_012), {}),
    "codebotler.models.base.ModelError": (A_SENTENCE, {"may_pass": True, "retry_after": 2.5}),
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
"""What each exception takes; one sentence by default."""


CLASS = re.compile(r"^class ([A-Za-z]\w*)\(([^)]*)\):", re.MULTILINE)


@cache
def exceptions() -> list[str]:
    """All that our modules define and do not keep to themselves."""
    found = []
    for path in sorted(SOURCES.rglob("*.py")):
        module = ".".join(path.relative_to(SOURCES).with_suffix("").parts)
        if module not in WITHIN:
            classes = CLASS.findall(path.read_text())
            found += [f"{module}.{name}" for name, bases in classes if ROOTS & {*re.split(r"\W+", bases)}]
    return found


def test_the_exceptions_are_found() -> None:
    assert {
        *MADE_OF,
        "codebotler.simulator.process.errors.EngineError",
        "codebotler.missions.mission.MissionError",
    } <= {*exceptions()}


@pytest.mark.parametrize("name", exceptions())
def test_an_exception_comes_whole_from_another_process(name: str) -> None:
    module, _, kind = name.rpartition(".")
    given, named = MADE_OF.get(name, (A_SENTENCE, {}))
    error = getattr(import_module(module), kind)(*given, **named)
    error.add_note("a note")
    for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
        again = pickle.loads(pickle.dumps(error, protocol))
        assert type(again) is type(error)
        assert (str(again), again.args, vars(again)) == (str(error), error.args, vars(error))
