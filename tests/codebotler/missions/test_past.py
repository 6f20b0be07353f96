"""A mission continues from the log of one that ended early, and repeats no step."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from codebotler.checking.check import check
from codebotler.checking.problems import CheckResult
from codebotler.checking.remaining import remaining_outcomes
from codebotler.checking.repetition import has_same_effect, with_repetition_problems
from codebotler.core.errors import UserError
from codebotler.core.skills.files import skills_from
from codebotler.core.skills.kinds import ASK, CHECK, GOTO, PICK, PLACE, SAY
from codebotler.core.skills.paper import SKILLS
from codebotler.core.text.text_template import ANY_TEXT
from codebotler.core.trace import Event, Option
from codebotler.core.world import Person, Room, World
from codebotler.missions.display.progress import Find
from codebotler.missions.display.view import MissionOrder, SessionView
from codebotler.missions.mission import Mission
from codebotler.missions.recovery import PriorApproval
from codebotler.missions.session import MissionSession
from codebotler.missions.storage.log import MissionState, MissionSummary, add_event, open_log, read_events
from codebotler.missions.storage.map_event import map_data
from codebotler.missions.storage.past import MissionPast, read_past
from codebotler.models.recorded import open_recorded
from codebotler.robots.reservation import Reservation
from codebotler.robots.simulated import Simulated
from codebotler.simulator.guard.contract import Contract, SkillBound
from codebotler.simulator.pool import shared_pool
from codebotler.simulator.worlds.room_map import RoomMap
from ended import cut, failed_mission, line_of

WORLD = World(
    (Room("hall"), Room("kitchen", ("mug",)), Room("lab", people=(Person("Anne", ("no",)),))), "hall"
)
ROOMS = RoomMap(("hall", "kitchen", "lab"), "kitchen", plain=True)
BRING = """
def task_program():
    go_to("kitchen")
    pick("mug")
    go_to("lab")
    if ask("Anne", "A mug?", ["yes", "no"]) == "no":
        say("Never mind.")
    place("mug")
    go_to("nowhere")
"""
FIND = """
def task_program():
    is_in_room("pen")
    go_to("kitchen")
    is_in_room("mug")
    pick("mug")
    go_to("lab")
    place("mug")
    ask("Anne", "A mug?", ["no"])
    go_to("nowhere")
"""
YES_NO = (Option("yes"), Option("no"))


def fail(home: Path, program: str) -> Path:
    return failed_mission(home, program, WORLD)


def test_past_of_a_robot_is_not_that_of_another_one_of_its_kind(tmp_path: Path) -> None:
    folder = fail(tmp_path, BRING)
    summary = MissionSummary.read(folder)
    summary.address = "ws://127.0.0.1:9090"
    summary.write(folder)
    for same in ("ws://LOCALHOST:9090/", ""):
        assert read_past(folder, SKILLS, address=same).mission == summary.id
    with pytest.raises(UserError):
        read_past(folder, SKILLS, address="ws://127.0.0.1:9091")


def test_past_lists_steps_with_their_places_and_answers(tmp_path: Path) -> None:
    past = read_past(fail(tmp_path, BRING), SKILLS)
    done = [(one.kind, one.text, one.place, one.answer) for one in past.trace]
    assert done == [
        ("goto", "kitchen", "hall", None),
        ("pick", "mug", "kitchen", None),
        ("goto", "lab", "kitchen", None),
        ("ask", "A mug?", "lab", "no"),
        ("say", "Never mind.", "lab", None),
        ("place", "mug", "lab", None),
        ("goto", "nowhere", "lab", None),
    ]
    assert [one.failed for one in past.trace if one.failed] == ["GoToInvalidLocation"]
    assert (past.place, past.held, past.unsure, past.program) == ("lab", "", None, BRING)
    assert past.why.startswith("GoToInvalidLocation")


def test_a_continuation_knows_what_was_found(tmp_path: Path) -> None:
    now = read_past(fail(tmp_path, FIND), SKILLS).progress
    assert (now.room, now.held, now.has_begun) == ("lab", "", False)
    assert set(now.finds) == {Find("lab", "mug"), Find("lab", "Anne")}
    folder = fail(tmp_path, FIND)
    cut(folder, line_of(folder, "pick", "skill") - 1)
    assert read_past(folder, SKILLS).progress.finds == (Find("kitchen", "mug"),)


@pytest.mark.parametrize(("skill", "held"), [("pick", "mug"), ("say", "mug"), ("place", "")])
def test_a_step_without_a_result_is_unsure_until_a_person_answers(
    tmp_path: Path, skill: str, held: str
) -> None:
    folder = fail(tmp_path, BRING)
    cut(folder, line_of(folder, skill, "skill"))
    past = read_past(folder, SKILLS)
    assert past.unsure is not None
    assert (past.unsure.kind, past.unsure.place) == (skill, past.place)
    assert past.unsure_step_text
    assert past.resolve(happened=True).trace == (*past.trace, past.unsure)
    assert past.resolve(happened=True).held == held
    assert past.resolve(happened=True).testimony != past.resolve(happened=False).testimony != ""
    assert past.resolve(happened=False).trace == past.trace
    assert past.resolve(happened=False).unsure is None


@pytest.mark.parametrize("skill", ["go_to", "pick"])
def test_a_drive_is_never_unsure_nor_is_a_step_with_a_result(tmp_path: Path, skill: str) -> None:
    folder = fail(tmp_path, BRING)
    cut(folder, line_of(folder, skill, "skill" if skill == "go_to" else "result"))
    assert read_past(folder, SKILLS).unsure is None


def test_a_failed_step_was_not_done(tmp_path: Path) -> None:
    program = 'def task_program():\n    pick("moon")\n'
    past = read_past(fail(tmp_path, program), SKILLS)
    ((tried,), unsure) = past.trace, past.unsure
    assert (tried.kind, tried.failed, unsure, past.place) == ("pick", "PickInvalidObject", None, "hall")
    assert (past.held, past.done, len(past.steps)) == ("", [], 1)
    left = remaining_outcomes(program, replace(ROOMS, past=past.trace), SKILLS)
    assert all(event.kind == "pick" for one in left for event in one.trace)


def test_a_mission_that_is_done_has_no_rest(tmp_path: Path) -> None:
    mission = Mission(tmp_path, "simulated")
    mission.set_program('def task_program():\n    say("a")\n')
    mission.record_check([])
    mission.approve()
    robot = Simulated(WORLD, speed=None)
    with Reservation(robot, tmp_path) as reserved, mission:
        mission.run(reserved, "hall")
    with pytest.raises(UserError):
        read_past(mission.folder, SKILLS)


def test_a_continuation_that_never_ran_leaves_the_past_unchanged(tmp_path: Path) -> None:
    past = read_past(fail(tmp_path, BRING), SKILLS)
    with Mission(tmp_path, "simulated", "Bring Anne the mug.") as mission:
        mission.continue_from(past)
        assert MissionSummary.read(mission.folder).continues == past.mission, "also if the tool is killed now"
        mission.fail("the model is away")
    again = read_past(mission.folder, SKILLS)
    assert again.mission == past.mission, "the mission that ran is continued"
    assert (again.trace, again.place, again.program, again.why) == (
        past.trace,
        past.place,
        past.program,
        past.why,
    )
    assert MissionSummary.read(mission.folder).continues == past.mission


def test_a_rest_that_did_not_run_leaves_the_question_open(tmp_path: Path) -> None:
    folder = fail(tmp_path, BRING)
    cut(folder, line_of(folder, "pick", "skill"))
    past = read_past(folder, SKILLS).resolve(happened=True)
    with Mission(tmp_path, "simulated", "Bring Anne the mug.") as mission:
        mission.continue_from(past)
        mission.fail("the model is away")
    assert past.testimony in [line["text"] for line in read_events(mission.folder) if line["event"] == "log"]
    assert read_past(mission.folder, SKILLS).unsure is not None


def test_a_persons_testimony_is_kept_through_all_continuations(tmp_path: Path) -> None:
    folder = fail(tmp_path, BRING)
    cut(folder, line_of(folder, "pick", "skill"))
    past = read_past(folder, SKILLS).resolve(happened=True)
    with Mission(tmp_path, "simulated", "Bring Anne the mug.") as mission:
        mission.continue_from(past)
        mission.set_program("def task_program():\n    go_to('nowhere')\n")
        mission.record_check([])
        mission.approve()
        with Reservation(Simulated(WORLD, speed=None), tmp_path) as reserved:
            mission.run(reserved, "hall")
    again = read_past(mission.folder, SKILLS)
    assert again.testimony == past.testimony
    second = replace(again, unsure=again.trace[-1]).resolve(happened=False)
    assert second.testimony.startswith(f"{past.testimony}; ")


def test_mission_that_tried_nothing_may_repeat_its_program(tmp_path: Path) -> None:
    folder = fail(tmp_path, BRING)
    assert read_past(folder, SKILLS).has_failed
    cut(folder, line_of(folder, "go_to", "skill"))  # A drive may be repeated.
    assert read_past(folder, SKILLS).is_untouched
    folder = fail(tmp_path, "def task_program():\n    undefined()\n")
    assert not read_past(folder, SKILLS).is_untouched  # It would fail again.


def test_mission_without_a_program_cannot_be_continued(tmp_path: Path) -> None:
    with Mission(tmp_path, "simulated", "Bring Anne the mug.") as mission:
        mission.fail("the model is away")
    with pytest.raises(UserError):
        read_past(mission.folder, SKILLS)


def test_the_rest_begins_after_the_steps_of_earlier_missions(tmp_path: Path) -> None:
    past = read_past(fail(tmp_path, BRING), SKILLS)
    with Mission(tmp_path, "simulated") as mission:
        mission.continue_from(past)
        mission.set_program("def task_program():\n    say('a')\n    go_to('nowhere')\n")
        mission.record_check([])
        mission.approve()
        with Reservation(Simulated(WORLD, speed=None), tmp_path) as reserved:
            mission.run(reserved, past.place)
    again = read_past(mission.folder, SKILLS)
    assert (past.before, again.before, len(again.trace)) == (0, len(past.trace), len(past.trace) + 2)
    with Mission(tmp_path, "simulated") as other:
        other.continue_from(again)
        other.fail("the model is away")
    assert read_past(other.folder, SKILLS).before == again.before


def test_simulated_robot_resumes_where_it_was(tmp_path: Path) -> None:
    folder = fail(tmp_path, BRING)
    cut(folder, line_of(folder, "ask", "result"))
    robot = Simulated(WORLD, speed=None)
    robot.connect()
    robot.resume(read_past(folder, SKILLS).trace)
    assert robot.perform("get_current_location", ()) == "lab"
    robot.perform("place", ["mug"])
    assert robot.perform("is_in_room", ["mug"])


# --- steps that the rest must not repeat


def check_rest(*lines: str, past: tuple[Event, ...], begun: str = BRING) -> set[str]:
    """Return the kinds of problems of a program for the rest."""
    program = "def task_program():\n    " + "\n    ".join(lines) + "\n"
    room_map = RoomMap(ROOMS.rooms, "lab", plain=True, past=past)
    found = check(program, room_map=room_map, pool=shared_pool())
    return {problem.kind for problem in with_repetition_problems(found, begun).problems}


SAID = Event(SAY, "There is no mug in room 3.", place="lab")
HELD = Event(PICK, "mug", place="kitchen")


@pytest.mark.parametrize(
    ("lines", "problems"),
    [
        (["say('There is no mug in room 3.')"], {"RepeatedStep"}),
        (["say('Sorry, there is no mug in room 3!')"], {"RepeatedStep"}),
        (["say('There is no mug in room 4.')"], set()),
        (["say('There is a mug in room 3.')"], set()),
        (["go_to('hall')", "say('There is no mug in room 3.')"], set()),
    ],
)
def test_rest_must_not_repeat_a_statement(lines: list[str], problems: set[str]) -> None:
    assert check_rest(*lines, past=(SAID,)) == problems


def test_comparison_with_a_long_past_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("codebotler.checking.repetition.MAX_COMPARED_PAIRS", 3)
    assert check_rest("say('a')", "say('b')", past=(SAID, replace(SAID, text="c"))) == {"LongPast"}
    assert check_rest("say('a')", past=(SAID, replace(SAID, text="c"))) == set()


@pytest.mark.parametrize(
    ("lines", "problems"),
    [
        (["place('mug')"], set()),
        (["say('Here.')"], {"KeepsThing"}),
        (["pick('plate')"], {"PickWhileHolding"}),
    ],
)
def test_rest_must_put_down_the_held_thing(lines: list[str], problems: set[str]) -> None:
    assert check_rest(*lines, past=(HELD,)) == problems


def test_a_thing_may_stay_in_hand_if_the_program_never_put_it_down() -> None:
    assert check_rest("say('Here.')", past=(HELD,), begun='def task_program():\n    pick("mug")\n') == set()


# --- steps that the program had left


def test_comparison_with_a_long_rest_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "codebotler.checking.repetition.MAX_COMPARED_PAIRS", 2
    )  # One step is done, two remain.
    assert follow(POLL, "def task_program():\n    say('Bye.')\n", WENT, ASKED) == {"LongPast"}


POLL = """
def task_program():
    go_to("lab")
    for _ in range(3):
        ask("Anne", "Is it hot?", ["yes", "no"])
    go_to("hall")
    say("Three people were asked.")
"""
WAIT = """
def task_program():
    go_to("lab")
    while not is_in_room("Anne"):
        time.sleep(1)
    say("Hello Anne")
"""
WENT = Event(GOTO, "lab", place="hall", destination="lab")
ASKED = Event(ASK, "is it hot?", YES_NO, "yes", place="lab", to="anne")
MISSED = Event(CHECK, "Anne", found=False, place="lab")


def follow(begun: str, rest: str, *past: Event, first: int = 0) -> set[str]:
    """Return the kinds of problems of a program for the rest, given the steps that remained."""
    room_map = replace(ROOMS, start="lab", past=past)
    found = check(rest, room_map=room_map, pool=shared_pool())
    left = remaining_outcomes(begun, room_map, SKILLS, first=first)
    return {problem.kind for problem in with_repetition_problems(found, begun, left).problems}


def poll(times: int, question: str = "Is it hot?") -> str:
    return POLL.replace("range(3)", f"range({times})").replace("Is it hot?", question)


@pytest.mark.parametrize("question", ["Is it hot?", "Would you say that it is hot outside?"])
@pytest.mark.parametrize(("times", "problems"), [(1, set()), (2, {"RepeatedStep"}), (3, {"RepeatedStep"})])
def test_rest_may_take_as_many_steps_as_remained(times: int, question: str, problems: set[str]) -> None:
    assert follow(POLL, poll(times, question), WENT, ASKED, ASKED) == problems


def test_steps_of_earlier_missions_do_not_count_as_this_programs() -> None:
    said = Event(SAY, "I begin.", place="hall")
    assert follow(POLL, poll(1), said, WENT, ASKED, ASKED) == {"RepeatedStep"}, (
        "the program does not say that first"
    )
    assert follow(POLL, poll(1), said, WENT, ASKED, ASKED, first=1) == set()


@pytest.mark.slow
def test_rest_may_wait_for_a_missing_person() -> None:
    rest = WAIT.replace("Hello", "Good morning")
    assert follow(WAIT, rest, WENT, MISSED) == set()
    assert follow(POLL, rest, WENT, MISSED) == set(), "she may come while the robot waits"
    for wrong in ("place('cup')", "ask('Nobody', 'Done?', [])"):
        assert follow(WAIT, f"{rest}    {wrong}\n", WENT, MISSED), "what comes after the wait is checked, too"
    leaves = WAIT.replace("not is_in_room", "is_in_room")
    assert follow(leaves, leaves, WENT, replace(MISSED, found=True)) == set()
    assert follow(leaves, f"{leaves}    place('cup')\n", WENT, replace(MISSED, found=True))


VISIT = """
def task_program():
    home = get_current_location()
    go_to("lab")
    while ask("Anne", "Do you want tea?", ["yes", "no"]) == "no":
        time.sleep(1)
    go_to(home)
"""
REFUSED = Event(ASK, "Do you want tea?", YES_NO, "no", place="lab", to="Anne")


@pytest.mark.slow
def test_endless_loop_sets_no_limit_on_steps() -> None:
    assert follow(VISIT, VISIT.replace("Do you want tea?", "May I bring you a cup?"), WENT, REFUSED) == set()


REPORT = "def task_program():\n    for room in ROOMS:\n        say(f'There is no stapler in {room} today.')\n"


@pytest.mark.parametrize(
    ("text", "problems"),
    [
        ("There is no stapler in the blue room today.", set()),
        ("No stapler in the blue room.", set()),
        ("No stapler in the red room.", {"RepeatedStep"}),
        ("There is no stapler in the red room and in the blue room today.", {"RepeatedStep"}),
        ("No stapler today.", set()),
    ],
)
def test_statement_is_compared_with_the_remaining_statements(text: str, problems: set[str]) -> None:
    begun = REPORT.replace("ROOMS", "['the red room', 'the blue room']")
    said = Event(SAY, "There is no stapler in the red room today.", place="lab")
    assert follow(begun, f"def task_program():\n    say({text!r})\n", said) == problems


def test_replay_of_the_past_knows_where_the_robot_was() -> None:
    room_map = replace(ROOMS, start="lab", past=(WENT, replace(REFUSED, answer="yes")))
    left = remaining_outcomes(VISIT, room_map, SKILLS)
    assert {tuple((event.kind, event.text) for event in one.trace) for one in left} == {((GOTO, "hall"),)}


def test_a_call_that_is_not_in_the_past_has_failed() -> None:
    begun = """
def task_program():
    go_to("lab")
    try:
        pick("mug")
    except Exception:
        say("There is no mug.")
    say(get_current_location())
"""
    said = Event(SAY, "there is no mug.", place="lab")
    room_map = replace(ROOMS, start="lab", past=(WENT, said))
    texts = {tuple(event.text for event in one.trace) for one in remaining_outcomes(begun, room_map, SKILLS)}
    assert texts == {("lab",)}


def test_a_session_compares_the_rest_with_the_remaining_steps(tmp_path: Path) -> None:
    mission = fail(tmp_path, BRING).name
    past = MissionPast(mission, "", "", POLL, "stopped", (WENT, ASKED, ASKED), "lab")
    session = MissionSession(
        Simulated(WORLD, speed=None),
        tmp_path,
        MissionOrder(program=poll(1), past=past),
        open_model=open_recorded,
        world=WORLD,
    )
    session.start()
    view = session.wait_until(lambda view: view.may_be_approved)
    session.stop("the test")
    assert view.check is not None
    assert view.check.problems == ()


def test_a_rest_that_was_done_meanwhile_is_not_done_again(tmp_path: Path) -> None:
    past = read_past(fail(tmp_path, BRING), SKILLS)
    rest = "def task_program():\n    say('hello')\n"

    def session() -> MissionSession:
        made = MissionSession(
            Simulated(WORLD, speed=None),
            tmp_path,
            MissionOrder(program=rest, past=past),
            open_model=open_recorded,
            world=WORLD,
        )
        made.start()
        return made

    first = session()
    first.approve(first.wait_until(lambda view: view.may_be_approved).digest, despite_problems=True)
    assert first.wait_until(lambda _: False).state is MissionState.DONE
    second = session().wait_until(lambda view: view.is_over or view.may_be_approved)
    assert second.is_over
    assert first.view.id in second.error


def test_program_that_contradicts_the_past_has_no_remaining_steps() -> None:
    room_map = replace(ROOMS, past=(SAID,))
    assert remaining_outcomes(POLL, room_map, SKILLS) == ()
    assert remaining_outcomes("def task_program():\n    pass\n", room_map, SKILLS) == ()


@pytest.mark.parametrize(
    ("one", "other", "is_same"),
    [
        (Event(ASK, "Tea?", YES_NO, place="lab"), Event(ASK, "Tea?", place="lab"), True),
        (Event(ASK, "Tea?", YES_NO, place="lab"), Event(ASK, "Coffee?", YES_NO, place="lab"), False),
        (Event(ASK, "Tea?", place="lab", to="A"), Event(ASK, "Tea?", place="lab", to="B"), False),
        (Event(ASK, "Tea?", place="lab", to="Anne"), Event(ASK, "Tea?", place="lab", to="anne"), True),
        (Event(SAY, "Welcome!", place="lab"), Event(SAY, "Hello and welcome!", place="lab"), True),
        (Event(PLACE, "mug", place="lab"), Event(PLACE, "the mug", place="the lab"), True),
        (Event(PLACE, "mug", place="lab"), Event(PLACE, "big mug", place="lab"), False),
        (Event(PICK, "mug", place="lab"), Event(PICK, "mug", place="lab"), False),
    ],
)
def test_equal_effects(one: Event, other: Event, is_same: bool) -> None:  # noqa: FBT001 - pytest passes it
    assert has_same_effect(one, other, ROOMS) is is_same


# --- recovering without a person


def view(*, say: int | None = 1, skill: str = "say") -> SessionView:
    bound = SkillBound((("message", (ANY_TEXT,)),), None, say)
    found = CheckResult((), (), ROOMS, contract=Contract({skill: bound}))
    return SessionView(check=found)


@pytest.mark.parametrize(
    ("approved", "done", "wanted", "allows"),
    [(2, 1, 1, True), (1, 1, 1, False), (None, 5, None, True), (2, 0, None, False)],
)
def test_an_approval_covers_the_rest_of_its_contract(
    tmp_path: Path,
    approved: int | None,
    done: int,
    wanted: int | None,
    allows: bool,  # noqa: FBT001 - pytest passes it
) -> None:
    past = read_past(fail(tmp_path, BRING), SKILLS)
    object.__setattr__(past, "trace", (Event(SAY, "a", place="lab"),) * done)
    approval = PriorApproval.of(view(say=approved))
    assert approval is not None
    assert approval.allows(view(say=wanted), past) is allows
    assert not approval.allows(view(skill="pick"), past)


def test_an_order_for_the_rest_needs_an_instruction_or_a_program(tmp_path: Path) -> None:
    past = read_past(fail(tmp_path, BRING), SKILLS)
    with pytest.raises(UserError):
        MissionOrder(past=past)
    assert MissionOrder(past.instruction, past=past).past is past


def test_a_person_may_know_the_answer_to_an_unsure_question(tmp_path: Path) -> None:
    folder = fail(tmp_path, BRING)
    cut(folder, line_of(folder, "ask", "skill"))
    past = read_past(folder, SKILLS)
    assert past.answers == ("yes", "no")
    assert past.resolve(happened=True, answer="no").trace[-1].answer == "no"
    assert past.resolve(happened=True).trace[-1].answer is None
    assert past.resolve(happened=True).steps[-1].endswith("answer unknown")
    with pytest.raises(UserError):
        past.resolve(happened=True, answer="perhaps")


FETCH = """
def task_program():
    go_to("lab")
    say("Looking for the zebra.")
    ask("Anne", "Tea or coffee?", ["tea", "coffee"])
    pick("zebra")
"""
TALKED = (
    WENT,
    Event(SAY, "Looking for the zebra.", place="lab"),
    Event(ASK, "Tea or coffee?", (Option("tea"), Option("coffee")), "tea", place="lab", to="Anne"),
)


@pytest.mark.parametrize(
    ("line", "problems"),
    [
        ("say('I cannot find the zebra.')", set()),
        ("say('Sorry for the delay.')", set()),
        ("ask('Anne', 'There is no tea. Do you want the mug instead?', ['yes', 'no'])", set()),
        ("ask('Anne', 'What may I bring, coffee or tea?', ['coffee', 'tea'])", {"RepeatedStep"}),
        ("say('I am looking for a zebra')", {"RepeatedStep"}),
    ],
)
def test_rest_may_report_or_ask_about_the_failure(line: str, problems: set[str]) -> None:
    assert follow(FETCH, f"def task_program():\n    {line}\n", *TALKED) == problems


def test_a_mission_is_continued_only_once(tmp_path: Path) -> None:
    folder = fail(tmp_path, BRING)
    past = read_past(folder, SKILLS)
    mission = Mission(tmp_path, "simulated", "Bring Anne the mug.")
    mission.continue_from(past)
    assert read_past(folder, SKILLS).trace == past.trace, "the continuation has not run yet"
    mission.set_program('def task_program():\n    go_to("nowhere")\n')
    mission.record_check([])
    mission.approve()
    with Reservation(Simulated(WORLD, speed=None), tmp_path) as reserved, mission:
        mission.run(reserved, "lab")
    with pytest.raises(UserError, match=mission.id):
        read_past(folder, SKILLS)
    *again, failed_drive = read_past(mission.folder, SKILLS).trace
    assert (tuple(again), failed_drive.failed) == (past.trace, "GoToInvalidLocation")
    with Mission(tmp_path, "simulated") as last:
        last.continue_from(read_past(mission.folder, SKILLS))
        last.set_program('def task_program():\n    say("done")\n')
        last.record_check([])
        last.approve()
        with Reservation(Simulated(WORLD, speed=None), tmp_path) as reserved:
            last.run(reserved, "lab")
    with pytest.raises(UserError, match=f"{last.id}, which is done"):
        read_past(folder, SKILLS)


def test_a_mission_of_another_robot_is_not_continued(tmp_path: Path) -> None:
    folder = fail(tmp_path, BRING)
    assert read_past(folder, SKILLS, "simulated").mission
    with pytest.raises(UserError):
        read_past(folder, SKILLS, "ros2")


def test_a_mission_on_another_map_is_not_continued(tmp_path: Path) -> None:
    folder = fail(tmp_path, BRING)
    with closing(open_log(folder)) as log:
        add_event(log, "map", 0.0, **map_data(WORLD))
    larger = World((*WORLD.rooms, Room("attic")), "hall")
    assert [read_past(folder, SKILLS, world=world).mission for world in (WORLD, larger)] == [folder.name] * 2
    with pytest.raises(UserError, match="lab"):
        read_past(folder, SKILLS, world=World(WORLD.rooms[:2], "hall"))


def test_own_skills_are_not_repeated_either(tmp_path: Path) -> None:
    (tmp_path / "kit.py").write_text(
        "from codebotler import skill\n\n\n"
        "@skill(verb='dispense {drug}', text='drug')\ndef dispense(sim, drug: str, person: str) -> None:\n"
        '    """Give a drug to a person."""\n\n\n'
        "@skill(event=None)\ndef ring_bell(sim) -> None:\n"
        '    """Ring the bell."""\n    sim.value("bell", True)\n'
    )
    table = skills_from(tmp_path / "kit.py")
    given = Event("dispense", "aspirin", place="lab", more=("Anne",))
    other = replace(given, more=("Bob",))
    assert has_same_effect(given, replace(given), ROOMS)
    assert not has_same_effect(given, other, ROOMS)
    program = 'def task_program():\n    ring_bell()\n    dispense("aspirin", "Anne")\n    go_to("nowhere")\n'
    robot = Simulated(WORLD, speed=None, skills=table)
    mission = Mission(tmp_path, "simulated", "Ring.")
    mission.set_program(program)
    mission.record_check([])
    mission.approve()
    with Reservation(robot, tmp_path) as reserved, mission:
        mission.run(reserved, "hall")
    for skill in ("dispense", "ring_bell"):
        cut(mission.folder, line_of(mission.folder, skill, "skill"))
        past = read_past(mission.folder, table)
        assert past.unsure is not None, skill
        assert past.resolve(happened=True).steps


def test_a_mission_that_never_ran_has_no_rest(tmp_path: Path) -> None:
    with Mission(tmp_path, "simulated", "Bring Anne the mug.") as mission:
        mission.set_program(BRING, "somebody")
        mission.record_check([])
        mission.stop("a person")
    with pytest.raises(UserError):
        read_past(mission.folder, SKILLS)
