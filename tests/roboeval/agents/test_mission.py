"""Test missions of agents in the simulator, and the programs made from them."""

import json
from collections.abc import Sequence
from contextlib import closing, suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codebotler.checking.contracts.file import contract_from
from codebotler.core.errors import VIOLATION, RobotError, UserError
from codebotler.core.trace import Option, Status, outcome_data
from codebotler.simulator.worker import Worker
from roboeval.evaluation.agents.mission import MAX_MISTAKES, MAX_REPEATS, AgentMission
from roboeval.evaluation.agents.plan import DEFAULT_TURNS
from roboeval.evaluation.judging.judge import evaluate, judge
from roboeval.evaluation.recording import SLEEP, RecordingRobot
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.rows import Row
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.suites.load import Scenario, Suite, load_suite
from roboeval.suites.suite import HouseRules

TASK, WORLD = "LunchTime", 0


@pytest.fixture
def mission(paper: Suite) -> AgentMission:
    return AgentMission(paper, paper.task(TASK).scenarios[WORLD].asked_by(0))


def judge_mission(mission: AgentMission, suite: Suite, *, index: int = 0) -> Row:
    assert mission.ending is not None
    more = {"world": WORLD, "ending": mission.ending, "no_program": None}
    completion = Completion(task=TASK, prompt=0, index=index, program=mission.program, more=more)
    (row,) = evaluate([completion], suite)
    return row


def test_calls_return_the_results_of_skills(mission: AgentMission) -> None:
    rooms = json.loads(mission.call("get_all_rooms", ""))
    assert mission.call("get_current_location", {}) in {json.dumps(room) for room in rooms}
    assert mission.call("is_in_room", '{"entity": "unicorn"}') == "false"
    assert mission.call("go_to", {"location": rooms[0]}) == "done"
    assert mission.mistakes == {}
    assert mission.ending is None


def test_ask_returns_the_option_that_a_person_chose(mission: AgentMission) -> None:
    mission.call("go_to", {"location": "jill's office"})
    options = ["yes", "no"]
    chosen = mission.call("ask", {"person": "Jill", "question": "Lunch?", "options": options})
    assert json.loads(chosen) in options
    assert mission.outcome.trace[-1].answer == json.loads(chosen)


def test_texts_are_lower_cased_like_those_of_programs(mission: AgentMission) -> None:
    mission.call("say", {"message": "Lunch at NOON"})
    assert mission.outcome.trace[-1].text == "lunch at noon"


def test_time_passes_while_an_agent_waits(mission: AgentMission) -> None:
    before, after = (mission.call("wait", {"seconds": seconds}) for seconds in (0, 90))
    assert before != after
    assert "time.sleep(90.0)" in mission.program


@pytest.mark.parametrize(
    ("name", "arguments", "kind"),
    [
        ("fly", {}, "UnknownTool"),
        ("go_to", {"room": "lobby"}, "WrongArguments"),
        ("go_to", {"location": 3}, "WrongArguments"),
        ("go_to", "not JSON", "WrongArguments"),
        ("go_to", "[]", "WrongArguments"),
        ("ask", {"person": "", "question": "?", "options": "yes"}, "WrongArguments"),
        ("wait", {"seconds": -1}, "WrongArguments"),
        ("wait", {"seconds": float("nan")}, "WrongArguments"),
    ],
)
def test_a_mistake_has_no_effect_and_the_third_in_a_row_ends_the_mission(
    mission: AgentMission, paper: Suite, name: str, arguments: str, kind: str
) -> None:
    for number in range(MAX_MISTAKES):
        assert mission.ending is None
        assert mission.call(name, arguments).startswith(f"{kind}: ")
        assert mission.mistakes == {kind: number + 1}
    assert mission.ending == kind
    assert not mission.outcome.trace
    with pytest.raises(UserError):
        mission.call("get_all_rooms", {})
    row = judge_mission(mission, paper)
    assert row["failure"] is not None
    assert row["failure"]["class"] == "AgentError"
    assert row["failure"]["kind"] == kind
    assert row["verdicts"][0]["status"] == "agent-error"


def test_a_right_call_between_mistakes_lets_the_mission_continue(mission: AgentMission) -> None:
    for _ in range(MAX_MISTAKES + 1):
        mission.call("fly", {})
        mission.call("get_all_rooms", {})
    assert mission.ending is None
    assert mission.mistakes["UnknownTool"] == MAX_MISTAKES + 1


def test_several_calls_at_once_are_a_mistake(mission: AgentMission) -> None:
    for _ in range(MAX_MISTAKES):
        mission.refuse_several(["go_to", "say"])
    assert mission.ending == "SeveralCalls"


def test_too_many_equal_calls_end_a_mission(mission: AgentMission, paper: Suite) -> None:
    while mission.ending is None:
        mission.call("is_in_room", {"entity": "jill"})
        if mission.ending is None:
            mission.call("wait", {"seconds": 1})
    assert mission.ending == "RepeatedCalls"
    assert sum(event.kind == "check" for event in mission.outcome.trace) == MAX_REPEATS
    assert mission.outcome.status is Status.TIMEOUT
    assert judge_mission(mission, paper)["failure"] == {
        "class": "AgentError", "kind": "RepeatedCalls", "world": 0, "check": None
    }  # fmt: skip


def test_giving_up_after_an_error_fails_with_that_error(mission: AgentMission, paper: Suite) -> None:
    mission.call("go_to", {"location": "the moon"})
    mission.call("give_up", {"reason": "no such room"})
    failure = judge_mission(mission, paper)["failure"]
    assert failure is not None
    assert (failure["class"], failure["kind"]) == ("RobotExecutionError", "GoToInvalidLocation")


def test_a_mistake_after_the_error_does_not_hide_the_cause(mission: AgentMission, paper: Suite) -> None:
    mission.call("say", {"message": "hello"})
    mission.call("go_to", {"location": "the moon"})
    mission.call("fly", {})
    mission.call("give_up", {"reason": "no such room"})
    row = judge_mission(mission, paper)
    assert row["failure"] is not None
    assert row["failure"]["kind"] == "GoToInvalidLocation"
    assert [event[0] for event in row["verdicts"][0]["trace"]] == ["say", "goto"]


def test_giving_up_without_an_error_is_the_agents_failure(mission: AgentMission, paper: Suite) -> None:
    mission.call("get_all_rooms", {})
    mission.call("give_up", {"reason": "I do not know"})
    failure = judge_mission(mission, paper)["failure"]
    assert failure is not None
    assert (failure["class"], failure["kind"]) == ("AgentError", "GaveUp")


def test_an_answer_without_any_call_fails_as_no_call(mission: AgentMission, paper: Suite) -> None:
    mission.answer("I would go there and ask her.")
    failure = judge_mission(mission, paper)["failure"]
    assert failure is not None
    assert (failure["class"], failure["kind"]) == ("AgentError", "NoCall")


def test_a_claim_of_success_is_judged_by_the_calls(mission: AgentMission, paper: Suite) -> None:
    mission.call("go_to", {"location": "jill's office"})
    mission.answer("Done! Jill comes at noon.")
    failure = judge_mission(mission, paper)["failure"]
    assert failure is not None
    assert failure["class"] == "TaskCompletionError"


def test_a_house_rule_ends_a_mission(tmp_path: Path, paper: Suite) -> None:
    file = tmp_path / "quiet.yaml"
    file.write_text("rules:\n- {name: away, says: Leave her., always: 'not tr.Exists(goto(\"jill\"))'}\n")
    suite = paper.with_house_rules(HouseRules.read(file))
    mission = AgentMission(suite, suite.task(TASK).scenarios[WORLD].asked_by(0))
    mission.call("go_to", {"location": "jill's office"})
    assert mission.ending == "error"
    assert mission.mistakes == {VIOLATION: 1}
    assert mission.outcome.error is not None
    assert mission.outcome.error.kind == VIOLATION
    failure = judge_mission(mission, suite)["failure"]
    assert failure is not None
    assert failure["kind"] == VIOLATION


def test_a_contract_ends_a_mission_before_a_forbidden_call(paper: Suite) -> None:
    allowed = contract_from({"get_all_rooms": {}, "say": {"message": ["hello"]}}, paper.skills)
    mission = AgentMission(paper, paper.task(TASK).scenarios[WORLD].asked_by(0), [allowed])
    mission.call("say", {"message": "hello"})
    mission.call("say", {"message": "goodbye"})
    assert mission.ending == "OutsideContract"
    assert [event.text for event in mission.outcome.trace] == ["hello"]
    row = judge_mission(mission, paper)
    assert len(row["verdicts"][0]["trace"]) == 1
    assert row["failure"] is not None
    assert (row["failure"]["class"], row["failure"]["kind"]) == ("AgentError", "OutsideContract")


def test_calls_of_a_program_are_written_with_their_types(mission: AgentMission) -> None:
    options = (Option("1", is_text=False), Option("True", is_text=False), Option("two", is_text=True))
    with suppress(RobotError):
        mission.robot.perform("ask", ["jill", "How many?", options])
    assert 'ask("jill", "How many?", [1, True, "two"])' in mission.program


def test_a_missing_world_is_named(paper: Suite) -> None:
    completion = Completion(task=TASK, prompt=0, index=0, program="", more={"world": 99, "ending": "answer"})
    with pytest.raises(UserError, match="LunchTime/0/0"):
        list(evaluate([completion], paper))


@pytest.mark.parametrize(
    "more", [{"world": 0}, {"world": -1, "ending": "answer"}, {"world": 0, "ending": "?"}]
)
def test_a_row_with_an_incomplete_ending_is_refused(more: dict[str, object]) -> None:
    with pytest.raises(UserError):
        Completion(task=TASK, prompt=0, index=0, program="", more=more)


CALLS = st.one_of(
    st.sampled_from(
        [
            ("get_all_rooms", {}),
            ("go_to", {"location": "jill's office"}),
            ("go_to", {"location": "nowhere"}),
            ("is_in_room", {"entity": "jill"}),
            ("ask", {"person": "jill", "question": "Lunch?", "options": ["Yes", "No"]}),
            ("ask", {"person": "jill", "question": "Lunch?", "options": []}),
            ("pick", {"obj": "apple"}),
            ("place", {"obj": "apple"}),
            ("wait", {"seconds": 0.1}),
            ("wait", {"seconds": 9_999}),
            ("wait", {"seconds": 1e300}),
            ("ask", {"person": "jill", "question": "How many?", "options": [1, 2]}),
            ("fly", {}),
            ("give_up", {"reason": "tired"}),
        ]
    ),
    st.builds(lambda text: ("say", {"message": text}), st.text() | st.text('\ud800"\\\n')),
)


@settings(max_examples=20)
@given(calls=st.lists(CALLS, max_size=12), ends=st.booleans())
def test_a_mission_and_its_program_do_the_same(
    paper: Suite, calls: Sequence[tuple[str, dict[str, object]]], *, ends: bool
) -> None:
    mission = AgentMission(paper, paper.task(TASK).scenarios[WORLD].asked_by(0))
    for name, arguments in calls:
        if mission.ending is None:
            mission.call(name, arguments)
    if mission.ending is None:
        mission.answer("done") if ends else mission.end("TurnLimit")
    verdict = judge(mission.outcome, mission.scenario)
    row = judge_mission(mission, paper)
    (of_program,) = row["verdicts"]
    assert (of_program["satisfied"], of_program["status"]) == (verdict.satisfied, mission.outcome.status)
    assert of_program["failed_checks"] == [one.text for one in verdict.failed]
    assert of_program["trace"] == outcome_data(mission.outcome)["trace"]


@pytest.mark.slow
def test_an_agent_can_do_each_task_within_the_default_turns() -> None:
    suite = load_suite("plus")
    with closing(Worker()) as worker:
        for one in recorded_completions("recorded:careful", suite):
            if one.prompt == 0 and one.index == 0:
                for scenario in suite.tasks[one.task].scenarios:
                    assert turns_to_pass(worker, suite, one, scenario) < DEFAULT_TURNS["agent"]


def turns_to_pass(worker: Worker, suite: Suite, one: Completion, scenario: Scenario) -> int:
    """Count a program's calls until its world's requirements hold; 0 if they never do."""
    robot, asked = RecordingRobot(scenario.world, suite), scenario.asked_by(one.prompt)
    if not judge(worker.run_alone(one.program, lambda: robot), asked).satisfied:
        return 0
    mission = AgentMission(suite, asked)
    for turns, (name, arguments) in enumerate(robot.calls, 1):
        with suppress(RobotError):
            if name == SLEEP:
                mission.robot.sleep_until(float(str(arguments[0])))
            else:
                mission.robot.perform(name, arguments)
        if judge(mission.outcome, asked).satisfied:
            return turns
    raise AssertionError(one.task, scenario.world.about)
