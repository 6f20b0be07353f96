"""Explains verdicts: what a program did in each world, and which step broke a requirement."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from codebotler.checking.storyboard import steps_of
from codebotler.core.terminal import shortened
from codebotler.core.text.words import counted
from codebotler.core.trace import Trace
from codebotler.rtl import explain
from roboeval.evaluation.judging.failures import no_program_sentence
from roboeval.evaluation.runs.completions import KEY, Completion
from roboeval.evaluation.runs.replies import reply_data
from roboeval.evaluation.runs.traces import trace_of
from roboeval.suites.load import Scenario, Suite

INSTRUCTION_NOT_RECORDED = "instruction not recorded"
OF_SUITE = "the suite's current prompt is:"
SUITE_CHANGED = "the suite has changed since the evaluation"
TRACE_CUT = "the trace was too long to save, so the failure cannot be explained"
TRACES_TOO_LONG = "the traces of this program are too long to explain this check"

LOWERCASED_NOTE = "This suite lower-cases strings before running; shown as judged."
MAX_PROGRAM_LINES = 1_000
MAX_EXPLAINED_SIZE = 100_000  # characters of all traces of a completion
EVENT_SIZE = 10  # characters that each event counts for in addition to its texts


def reason(row: Mapping[str, Any], suite: Suite | None, *, ablated: bool) -> dict[str, Any]:
    """Return as JSON data why a completion failed: its first failing world, and the error or failed check.

    `ablated` says whether it was judged by the requirements of common sense only.
    """
    why = row["failure"]
    verdict = row["verdicts"][why["world"]]
    ending = {key: verdict[key] for key in ("world", "error", "line")}
    if why["check"] is None:
        explanation = no_program_sentence(why)
        return {"passed": False, "failure": why, **ending, "explanation": explanation, "step": None}
    scenario = _scenario(suite, row, why["world"], ablated=ablated)
    explained = _explained(why["check"], scenario, verdict, trace_of(verdict), ExplanationBudget())
    return {"passed": False, "failure": why, **ending, **explained}


def completion_data(
    row: Mapping[str, Any], completion: Completion, suite: Suite | None, *, ablated: bool = False
) -> dict[str, Any]:
    """Return a completion as JSON data: instruction, program, and each world's steps and failed checks."""
    budget = ExplanationBudget()
    return {
        **{key: row[key] for key in (*KEY, "passed", "failure")},
        **{key: getattr(completion, key) for key in ("model", "instruction", "program")},
        "suite_instruction": suite_instruction(suite, row["task"], row["prompt"]),
        "reply": reply_data(completion),
        "lowered": suite is not None and suite.settings.literals == "lowercase",
        "worlds": [
            _world_data(verdict, _scenario(suite, row, number, ablated=ablated), budget)
            for number, verdict in enumerate(row["verdicts"])
        ],
    }


def suite_instruction(suite: Suite | None, task: str, prompt: int) -> str | None:
    """Return the instruction of a prompt in a suite, or None if there is no suite or it lacks the prompt."""
    prompts = () if suite is None or task not in suite.tasks else suite.tasks[task].prompts
    return prompts[prompt] if prompt < len(prompts) else None


def instruction_shown(recorded: str | None, of_suite: str | None) -> tuple[str | None, str | None]:
    """Return a note (None if `recorded` is given), and the instruction: `recorded`, or else `of_suite`."""
    if recorded is not None or of_suite is None:
        return INSTRUCTION_NOT_RECORDED if recorded is None else None, recorded
    return f"{INSTRUCTION_NOT_RECORDED}; {OF_SUITE}", of_suite


def failing_first(worlds: Iterable[Mapping[str, Any]]) -> list[tuple[int, Mapping[str, Any]]]:
    """Return the worlds with their numbers, which start at 1. Failing worlds come first."""
    return sorted(enumerate(worlds, 1), key=lambda one: bool(one[1]["satisfied"]))


class ExplanationBudget:
    """Limits the total size of a completion's traces that are analysed to explain failed checks."""

    def __init__(self) -> None:
        self._left = MAX_EXPLAINED_SIZE

    def covers(self, trace: Trace) -> bool:
        """Subtract a trace's size from the budget. Return False if the budget was too small."""
        texts = [text for event in trace for text in (event.text, *(option.text for option in event.options))]
        self._left -= EVENT_SIZE * len(trace) + sum(map(len, texts))
        return self._left >= 0


def _scenario(suite: Suite | None, row: Mapping[str, Any], number: int, *, ablated: bool) -> Scenario | None:
    task = None if suite is None else suite.tasks.get(row["task"])
    scenarios = () if task is None else task.judged_in(ablated=ablated)
    about = row["verdicts"][number]["world"]
    return next((s for s in (*scenarios[number : number + 1], *scenarios) if s.world.about == about), None)


def _world_data(
    verdict: Mapping[str, Any], scenario: Scenario | None, budget: ExplanationBudget
) -> dict[str, Any]:
    trace, cut = trace_of(verdict), verdict.get("cut")
    return {
        **{key: verdict[key] for key in ("world", "satisfied", "status", "error", "line")},
        "steps": steps_of(trace, has_places=True),
        **({} if cut is None else {"cut": cut}),
        "failed_checks": [
            {"check": check, **_explained(check, scenario, verdict, trace, budget)}
            for check in verdict["failed_checks"]
        ],
    }


def _explained(
    check: str, scenario: Scenario | None, verdict: Mapping[str, Any], trace: Trace, budget: ExplanationBudget
) -> dict[str, Any]:
    if "cut" in verdict:
        return {"explanation": TRACE_CUT, "step": None}
    require = () if scenario is None else scenario.require
    requirement = next((r for r in require if r.text == check), None)
    if requirement is None:
        return {"explanation": f"{SUITE_CHANGED}: this world no longer has this requirement", "step": None}
    if not budget.covers(trace):
        return {"explanation": TRACES_TOO_LONG, "step": None}
    why = explain(requirement.formula, trace)
    if why is None:
        return {"explanation": f"{SUITE_CHANGED}; this requirement is now satisfied", "step": None}
    return {"explanation": why.sentence, "step": None if why.event is None else why.event + 1}


def error_sentence(verdict: Mapping[str, Any]) -> str:
    """Return the error that ended a run, such as `line 3: the door is locked`. Omit an unknown line."""
    where = "" if verdict["line"] is None else f"line {verdict['line']}"
    return ": ".join(filter(None, (where, verdict["error"]["message"])))


def first_lines(program: str) -> tuple[str, int]:
    """Return a program's first 1,000 lines, with long ones shortened, and the number of lines left out."""
    lines = program.replace("\r\n", "\n").replace("\r", "\n").rstrip("\n").split("\n")
    shown = "\n".join(shortened(line.expandtabs(4)) for line in lines[:MAX_PROGRAM_LINES])
    return shown, max(0, len(lines) - MAX_PROGRAM_LINES)


def cut_sentence(cut: Mapping[str, Any]) -> str:
    """Return a sentence such as "2 more steps were not saved, because the trace is too long"."""
    were = "was" if cut["events"] == 1 else "were"
    return f"{counted(cut['events'], 'more step')} {were} not saved, because the trace is too long"
