"""Views of prompts and completions: reasons, storyboards, and programs that stay text on the terminal."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console, RenderableType

from codebotler.core.trace import Event, Option, Outcome, RunError, Status, Trace
from codebotler.core.world import Person, Room, World
from codebotler.rtl import Explanation, Formula, explain, parse
from codebotler.simulator.settings import SimulationSettings
from made_results import results_of, row_of, with_places
from roboeval.analysis.counting.tasks import prompt_data, task_data
from roboeval.cli.views.completions import completion_view as view_of_completion
from roboeval.cli.views.completions import prompt_view
from roboeval.cli.views.results import task_view
from roboeval.evaluation.judging.explanation import (
    INSTRUCTION_NOT_RECORDED,
    LOWERCASED_NOTE,
    OF_SUITE,
    completion_data,
)
from roboeval.evaluation.judging.judge import judge
from roboeval.evaluation.judging.serialization import judgement
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.results import Results
from roboeval.suites.load import Requirement, Scenario, Suite, Task

HOSTILE = "[red]x[/red]\x1b[2J\x07\u202e\ud800"
SHOWN = r"[red]x[/red]\x1b[2J\x07\u202e\ud800"

WORLD = World(
    rooms=(Room("start"), Room("office", people=(Person("amy", ("yes",)),)), Room("lab")),
    robot="start",
    about="amy is in",
)


def requirement(name: str, rtl: str) -> Requirement:
    return Requirement(name, name, parse(rtl), "Location")


VISITS = requirement("visits", 'tr.Exists(goto("office"))')
GREETS = requirement('greets("amy")', 'tr.ActAtFirst("office", say("hello"))')
BIDS = requirement("bids_farewell", 'tr.Exists(say("bye"))')
WAITING = replace(WORLD, about="nobody comes", may_wait_forever=True)
TASK = Task(
    name="Visit",
    summary="Visit Amy.",
    abilities=(),
    prompts=("Visit Amy.",),
    facts=(),
    checks=(),
    scenarios=(Scenario(WORLD, (VISITS, GREETS)), Scenario(WAITING, ())),
    ablation=(Scenario(WORLD, (BIDS,)), Scenario(WAITING, ())),
    accepted=(),
    path=Path("Visit.yaml"),
)
SUITE = Suite("small", 1, "", SimulationSettings(), {"Visit": TASK}, "0")

GOTO, HELLO = Event("goto", "office"), Event("say", "hello")
FINE = Outcome(Status.FINISHED, (GOTO, HELLO))
MUTE = Outcome(Status.FINISHED, with_places(WORLD, GOTO, Event("goto", "lab"), HELLO))


def completion(index: int = 0, program: str = "x = 1\ny = 2\n", **fields: Any) -> Completion:  # noqa: ANN401 - any field
    return Completion(task="Visit", prompt=0, index=index, program=program, **fields)


def row(written: Completion, *outcomes: Outcome, ablated: bool = False) -> dict[str, Any]:
    scenarios = TASK.judged_in(ablated=ablated)
    verdicts = [judge(o, s) for o, s in zip(outcomes, scenarios, strict=False)]
    return dict(row_of(written, judgement(verdicts)))


def failure(status: Status, kind: str, message: str, *events: Event, line: int | None = None) -> Outcome:
    return Outcome(status, events, RunError(kind, message), line)


def text_of(renderable: RenderableType, width: int = 80, *, colour: bool = False) -> str:
    console = Console(width=width, force_terminal=colour, color_system="standard" if colour else None)
    with console.capture() as captured:
        console.print(renderable)
    return "\n".join(line.rstrip() for line in captured.get().splitlines())


def completion_view(
    row: Mapping[str, Any], written: Completion, suite: Suite, *, in_full: bool = False
) -> RenderableType:
    return view_of_completion(completion_data(row, written, suite), in_full=in_full)


def results(
    rows: Sequence[Mapping[str, Any]], written: Sequence[Completion], *, ablated: bool = False
) -> Results:
    return results_of(rows, SUITE, completions=written, ablated=ablated)


# --- a prompt


LOST = failure(Status.ROBOT_ERROR, "GoToInvalidLocation", 'there is no room "moon"', line=2)
COMPLETIONS = [completion(0), completion(1), completion(2, "mute"), completion(3, "lost")]
ROWS = [row(c, o, FINE) for c, o in zip(COMPLETIONS, [FINE, FINE, MUTE, LOST], strict=True)]


def test_a_prompt_groups_equal_programs_and_gives_reasons() -> None:
    data = prompt_data(results(ROWS, COMPLETIONS), "Visit", 0)
    json.dumps(data)
    assert (data["completions"], data["passed"], data["pass@1"]) == (4, 2, 0.5)
    assert [program["indices"] for program in data["programs"]] == [[0, 1], [2], [3]]
    assert [program["passed"] for program in data["programs"]] == [True, False, False]
    assert data["programs"][1]["failure"]["check"] == 'greets("amy")'
    assert "at step 3" in data["programs"][1]["explanation"]
    assert data["programs"][2]["line"] == 2


def test_a_prompt_is_shown_line_by_line() -> None:
    text = text_of(prompt_view(prompt_data(results(ROWS, COMPLETIONS), "Visit", 0)), 160)
    unrecorded = f"{INSTRUCTION_NOT_RECORDED}; {OF_SUITE}"
    assert text.startswith(
        f"Visit/0  2 of 4 passed (pass@1 0.50)\n{unrecorded}\nVisit Amy.\n\n  0  x2  passed\n"
    )
    assert '  2  failed check: Location in "amy is in"\n     greets("amy"): ' in text
    assert (
        '  3  robot error: GoToInvalidLocation in "amy is in"\n     line 2: there is no room "moon"'
    ) in text


# --- a completion


def test_a_completion_is_shown_world_by_world() -> None:
    written = completion(program="go_to('office')\nsay('hello')\n", instruction="Visit her.", model="m")
    answered = Event("ask", "lunch?", (Option("yes"), Option("5", is_text=False)), answer="yes")
    trace = with_places(
        WORLD,
        Event("check", "amy", found=False),
        GOTO,
        Event("check", "amy", found=True),
        answered,
        Event("goto", "moon"),
        Event("goto", "the lab, please"),
        Event("pick", "mug"),
        Event("place", "mug"),
        Event("wave", "amy"),
    )
    text = text_of(completion_view(row(written, Outcome(Status.FINISHED, trace)), written, SUITE), 110)
    assert text.startswith("Visit/0/0  failed check: Location\nwritten by m\nVisit her.\n\n")
    assert "  1 go_to('office')\n  2 say('hello')\n" in text
    story = """World: amy is in
not satisfied, finished
     in start
  1      looked for "amy": not found
❱ 2  start → office
  3      looked for "amy": found
  4      asked "lunch?" [yes | 5 (no text)] → yes
  5  office → "moon"  failed: there is no such room
  6  office → lab  (asked for "the lab, please")
  7      picked up "mug"
  8      put down "mug"
  9      did wave "amy"
  failed greets("amy"): the robot"""
    assert story in text


def test_an_error_marks_its_line_and_an_allowed_timeout_does_not() -> None:
    waits = failure(Status.TIMEOUT, "TimeoutError", "1,000 skill calls", line=1)
    text = text_of(completion_view(row(completion(), LOST, waits), completion(), SUITE, in_full=True))
    assert "  1 x = 1\n❱ 2 y = 2\n" in text
    assert 'not satisfied, robot-error: GoToInvalidLocation, line 2: there is no room "moon"' in text
    assert "\n  the robot did nothing" in text
    assert "satisfied, timeout (allowed here): TimeoutError, line 1: 1,000 skill calls" in text


BOTH = replace(SUITE, tasks={"Visit": replace(TASK, scenarios=(Scenario(WAITING, ()), TASK.scenarios[0]))})


def test_the_deciding_world_comes_first_and_satisfied_ones_are_single_lines() -> None:
    waits = failure(Status.TIMEOUT, "TimeoutError", "1,000 skill calls", GOTO, line=1)
    verdicts = [judge(o, s) for o, s in zip((waits, MUTE), BOTH.tasks["Visit"].scenarios, strict=True)]
    judged = row_of(completion(), judgement(verdicts))
    text = text_of(completion_view(judged, completion(), BOTH), 120)
    short = "World 1 of 2: nobody comes  satisfied, timeout (allowed here), 1 step\n--all shows"
    assert text.index("World 2 of 2: amy is in\nnot satisfied") < text.index(short)
    assert re.search(r"❱ 3 +said", text)
    full = text_of(completion_view(judged, completion(), BOTH, in_full=True), 120)
    assert full.index("World 2 of 2") < full.index(
        "World 1 of 2: nobody comes\nsatisfied, timeout (allowed here)"
    )
    assert "--all" not in full
    worlds = completion_data(judged, completion(), BOTH)["worlds"]
    assert [world["world"] for world in worlds] == ["nobody comes", "amy is in"]


@pytest.mark.parametrize(("recorded", "prompt"), [(None, 0), ("Visit her.", 0), (None, 7)])
def test_the_suites_instruction_is_a_separate_field(recorded: str | None, prompt: int) -> None:
    written = completion(instruction=recorded)
    data = completion_data({**row(written, FINE), "prompt": prompt}, written, SUITE)
    assert data["instruction"] == recorded
    assert data["suite_instruction"] == ("Visit Amy." if prompt == 0 else None)
    assert completion_data(row(written, FINE), written, None)["suite_instruction"] is None


def test_an_error_without_a_message_shows_its_kind_and_line() -> None:
    for line, where in ((2, ", line 2"), (None, "")):
        full = row(completion(), failure(Status.KILLED, "MemoryError", "", line=line))
        text = text_of(completion_view(full, completion(), SUITE))
        assert f"\nnot satisfied, killed: MemoryError{where}\n" in text
        text = text_of(prompt_view(prompt_data(results([full], [completion()]), "Visit", 0)))
        assert text.endswith('MemoryError in "amy is in"' + ("\n     line 2" if line else ""))


def test_lines_keep_their_numbers_with_any_line_ending() -> None:
    written = completion(program="\n\r\n\rx = (\n\n\n")
    text = text_of(completion_view(row(written, LOST), written, SUITE))
    assert "  4 x = (\n" in text
    assert "  5" not in text


def test_a_completion_without_instruction_shows_the_suites() -> None:
    text = text_of(completion_view(row(completion(), FINE), completion(program=""), SUITE))
    assert f"{INSTRUCTION_NOT_RECORDED}; {OF_SUITE}\nVisit Amy." in text


def test_tasks_and_prompts_say_that_no_instruction_was_recorded() -> None:
    for text in (
        text_of(task_view(task_data(results(ROWS, COMPLETIONS[:1]), "Visit"))),
        text_of(prompt_view(prompt_data(results(ROWS, COMPLETIONS[:1]), "Visit", 0))),
    ):
        assert "instruction not recorded" in text


def test_a_completion_as_json_has_every_step() -> None:
    written = completion(model="m")
    trace = with_places(WORLD, *[GOTO] * 999)
    data = completion_data(row(written, Outcome(Status.FINISHED, trace)), written, SUITE)
    json.dumps(data)
    world = data["worlds"][0]
    assert len(world["steps"]) == 999
    assert world["steps"][1] == {
        "step": 2,
        "kind": "goto",
        "text": "office",
        "place": "office",
        "to": "office",
    }
    assert world["failed_checks"][0]["check"] == 'greets("amy")'
    assert (data["instruction"], data["program"], data["model"]) == (None, "x = 1\ny = 2\n", "m")


def test_an_ablation_is_explained_by_its_own_requirements() -> None:
    only = row(completion(), MUTE, ablated=True)
    data = completion_data(only, completion(), SUITE, ablated=True)
    assert '"bye"' in data["worlds"][0]["failed_checks"][0]["explanation"]
    of_prompt = prompt_data(results([only], [completion()], ablated=True), "Visit", 0)
    assert '"bye"' in of_prompt["programs"][0]["explanation"]


def test_worlds_with_the_same_name_are_matched_by_order() -> None:
    suite = replace(
        SUITE, tasks={"Visit": replace(TASK, scenarios=(Scenario(WORLD, ()), Scenario(WORLD, (BIDS,))))}
    )
    verdicts = [judge(MUTE, scenario) for scenario in suite.tasks["Visit"].scenarios]
    data = completion_data(row_of(completion(), judgement(verdicts)), completion(), suite)
    assert '"bye"' in data["worlds"][1]["failed_checks"][0]["explanation"]


def test_a_suite_that_has_changed_is_mentioned() -> None:
    gone = replace(SUITE, tasks={"Visit": replace(TASK, scenarios=(Scenario(WORLD, (VISITS,)),))})
    met = replace(TASK, scenarios=(Scenario(WORLD, (replace(VISITS, text='greets("amy")'),)),))
    cases = [
        (gone, "the suite has changed .* no longer has this requirement"),
        (replace(SUITE, tasks={"Visit": met}), "the suite has changed .* now satisfied"),
    ]
    for suite, sentence in cases:
        text = text_of(completion_view(row(completion(), MUTE), completion(), suite), 160)
        assert re.search(rf'failed greets\("amy"\): {sentence}', text)


def test_a_world_missing_from_the_suite_still_shows_its_trace() -> None:
    renamed = replace(TASK, scenarios=(Scenario(replace(WORLD, about="amy is out"), (VISITS, GREETS)),))
    for suite in (replace(SUITE, tasks={}), replace(SUITE, tasks={"Visit": renamed})):
        text = text_of(completion_view(row(completion(), MUTE), completion(), suite), 160)
        assert '1  start → office\n2  office → lab\n3      said "hello"\n' in text


# --- long traces and texts


def test_a_long_trace_is_shortened_in_its_middle() -> None:
    waits = [Event("check", "amy", found=False), Event("say", "hm")] * 499
    trace = with_places(WORLD, GOTO, *waits, Event("goto", "start"))
    text = text_of(completion_view(row(completion(), Outcome(Status.FINISHED, trace)), completion(), SUITE))
    assert "     ... 982 more ...\n" in text
    assert "\n1000  office → start\n" in text
    assert "\n 500 " not in text


def test_a_step_in_an_explanation_is_never_omitted() -> None:
    once = requirement("is_silent", 'not tr.Exists(say("hm"))')
    suite = replace(SUITE, tasks={"Visit": replace(TASK, scenarios=(Scenario(WORLD, (once,)),))})
    trace = (*[Event("check", f"n{i}", found=False) for i in range(500)], Event("say", "hm"), *[GOTO] * 100)
    verdict = judge(Outcome(Status.FINISHED, trace), suite.tasks["Visit"].scenarios[0])
    text = text_of(completion_view(row_of(completion(), judgement([verdict])), completion(), suite))
    assert '\n       ... 488 more ...\n❱ 501      said "hm"\n       ... 94 more ...\n' in text


def test_a_long_text_is_shortened() -> None:
    trace = (Event("say", "a" * 10_000), Event("ask", "q", (Option("o"),) * 30))
    text = text_of(completion_view(row(completion(), Outcome(Status.FINISHED, trace)), completion(), SUITE))
    assert "9,500 more characters" in text.replace("\n      ", "")
    assert "10 more] → no answer" in text
    assert len(text) < 3_000


# --- text of models


@pytest.mark.parametrize("colour", [False, True])
def test_hostile_text_of_a_model_stays_text(*, colour: bool) -> None:
    trace = (
        Event("say", HOSTILE),
        Event("goto", HOSTILE),
        Event("ask", HOSTILE, (Option(HOSTILE), Option(HOSTILE, is_text=False))),
        Event(HOSTILE, HOSTILE),
    )
    silent = Outcome(Status.FINISHED, trace)
    fails = failure(Status.PYTHON_ERROR, HOSTILE, HOSTILE, *trace, line=1)
    written = completion(program=f"say('{HOSTILE}')\r\n\t# {HOSTILE}", instruction=HOSTILE, model=HOSTILE)
    rows = [row(written, silent), row(written, fails), row(written, fails)]
    rows[2]["verdicts"][0]["world"] = HOSTILE
    for one in rows:
        views = [
            completion_view(one, written, SUITE),
            prompt_view(prompt_data(results([one], [written]), "Visit", 0)),
            task_view(task_data(results([one], [written]), "Visit")),
        ]
        for shown in views:
            text = text_of(shown, 400, colour=colour)
            assert SHOWN in text
            for control in ("\x1b[2J", "\x07", "\u202e", "\ud800"):
                assert control not in text
            assert colour or "\x1b" not in text


@pytest.mark.parametrize("width", [80, 120])
def test_views_fit_the_width(width: int) -> None:
    judged = results(ROWS, COMPLETIONS)
    for view in (
        task_view(task_data(judged, "Visit")),
        prompt_view(prompt_data(judged, "Visit", 0)),
        completion_view(ROWS[2], COMPLETIONS[2], SUITE),
    ):
        text = text_of(view, width)
        assert max(map(len, text.splitlines())) <= width


def test_only_the_first_very_long_traces_are_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    events = [Event("say", "no " * 1_000)] * 10
    task = replace(TASK, scenarios=tuple(Scenario(replace(WORLD, about=str(n)), (BIDS,)) for n in range(30)))
    suite = replace(SUITE, tasks={"Visit": task})
    verdicts = [judge(Outcome(Status.FINISHED, tuple(events)), s) for s in task.scenarios]
    one = row_of(completion(), judgement(verdicts))
    compared = []

    def note_length(formula: Formula, trace: Trace) -> Explanation | None:
        compared.append(sum(len(event.text) for event in trace))
        return explain(formula, trace)

    monkeypatch.setattr("roboeval.evaluation.judging.explanation.explain", note_length)
    worlds = completion_data(one, completion(), suite)["worlds"]
    why = [check["explanation"] for world in worlds for check in world["failed_checks"]]
    assert len(why) == 30
    assert "never said" in why[0]
    assert "too long" in why[-1]
    assert 0 < sum(compared) <= 100_000


def test_lowercased_texts_are_shown_as_judged() -> None:
    said = Outcome(Status.FINISHED, (GOTO, Event("say", "good day")))
    for settings in (SimulationSettings(), SimulationSettings(literals="as-written")):
        suite = replace(SUITE, settings=settings)
        written = replace(completion(), program="def task_program():\n    say('Good Day')\n")
        text = text_of(completion_view(row(written, said), written, suite), 120)
        assert 'said "good day"' in text
        assert (LOWERCASED_NOTE in text) is (settings == SimulationSettings())
