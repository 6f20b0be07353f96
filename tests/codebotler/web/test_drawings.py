"""Pages draw a mission's progress, its rooms, and the storyboards of a program."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from typing import Any

import pytest

from codebotler.checking.check import check
from codebotler.checking.problems import Problem
from codebotler.checking.storyboard import MAX_SHOWN_STEPS, select_steps, steps_of
from codebotler.core.trace import Event, Option
from codebotler.core.world import Room, World
from codebotler.core.world_file import read_world
from codebotler.missions.display.progress import _MAX_MOMENTS, _MAX_STEPS, Find, Moment, Progress
from codebotler.missions.display.view import SessionView
from codebotler.missions.display.wording import timeline, title
from codebotler.missions.storage.log import MissionState, MissionSummary
from codebotler.robots.simulated import OFFICE
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.web.floorplan import _HALO_RADIUS, MAX_DRAWN_ROOMS, MapState, floorplan
from codebotler.web.panes.robot import map_state
from codebotler.web.storyboard import (
    _LEFT_OUT,
    MAX_STRIPS,
    Action,
    Scene,
    Strip,
    scenes,
    scenes_reached,
    strips,
)

SVG = "{http://www.w3.org/2000/svg}"


def line(event: str, clock: float = 1.0, **data: Any) -> dict[str, Any]:  # noqa: ANN401 - JSON
    return {"time": 0.0, "clock": clock, "event": event, **data}


def call(skill: str, **arguments: object) -> dict[str, Any]:
    return line("skill", number=1, skill=skill, arguments=arguments)


def done(skill: str, *, result: object = None) -> dict[str, Any]:
    return line("result", number=1, skill=skill, result=result)


def after(*lines: dict[str, Any]) -> Progress:
    progress = Progress()
    for each in lines:
        progress = progress.after(each)
    return progress


def test_progress_shows_the_current_skill_and_place() -> None:
    driving = after(call("go_to", location="study"), line("feedback", text="at (1.5, -2.0)"))
    assert (driving.doing, driving.room, driving.at) == ('drives to "study"', "study", (1.5, -2.0))
    assert driving.is_driving
    there = driving.after(line("result", number=1, skill="go_to", result=None))
    assert (there.doing, there.skill, there.is_driving, there.room) == ("", "", False, "study")


def test_moments_distinguish_questions_answers_and_statements() -> None:
    asked = after(
        call("ask", person="ann", question="tea?", options=["yes", "no"]),
        line("result", number=1, skill="ask", result="yes"),
        call("say", message="fine"),
    )
    assert asked.moments == (
        Moment(1.0, "ask", "tea? [yes | no]"),
        Moment(1.0, "answer", "yes"),
        Moment(1.0, "say", "fine"),
    )


def test_progress_lists_visited_rooms_finds_and_the_held_thing() -> None:
    """Rooms keep the words of the program, since only the robot knows their meaning."""
    on_the_way = after(call("go_to", location="kitchen"), line("feedback", text="at (1.0, 2.0)"))
    assert (on_the_way.visited, on_the_way.trail) == ((), ((1.0, 2.0),))
    events = [
        *(call("go_to", location="Kitchen"), line("feedback", text="at (1.0, 2.0)")),
        *(line("feedback", text="at (1.01, 2.0)"), line("feedback", text="at (3.0, 2.0)"), done("go_to")),
        *(call("is_in_room", entity="mug"), done("is_in_room", result=True)),
        *(call("is_in_room", entity="cup"), done("is_in_room", result=False)),
        *(call("is_in_room", entity="mug"), done("is_in_room", result=True)),
        *(call("ask", person="ann", question="Tea?", options=["no"]), done("ask", result="no")),
        *(call("ask", person="", question="Tea?", options=["no"]), done("ask", result="no")),
        *(call("pick", obj="mug"), done("pick")),
    ]
    now = after(*events)
    assert now.visited == ("Kitchen",)
    assert now.trail == ((1.0, 2.0), (3.0, 2.0))
    assert (after(*events[:-2]).finds) == (Find("Kitchen", "mug"), Find("Kitchen", "ann"))
    assert (now.finds, now.held) == ((Find("Kitchen", "ann"),), "mug")
    put_down = after(*events, call("place", obj="mug"), done("place"))
    assert (put_down.finds, put_down.held) == ((Find("Kitchen", "ann"), Find("Kitchen", "mug")), "")
    failed = line("error", number=1, skill="go_to", kind="E", message="m")
    assert after(call("go_to", location="attic"), failed).visited == ()


def test_a_robot_stopped_on_its_way_is_in_the_room_of_its_position() -> None:
    world = read_world(OFFICE)

    def show(*lines: dict[str, Any]) -> MapState:
        rooms = RoomMap.of(world)
        return map_state(SessionView(room_map=rooms, progress=after(*lines)), world)

    first = [call("go_to", location="printer room 2"), line("feedback", text="at (7.0, 3.0)"), done("go_to")]
    second = [call("go_to", location="printer room 3"), line("feedback", text="at (8.5, 3.0)")]
    cancelled = line("cancelled", number=2, skill="go_to")
    assert show(*first).room == "printer room 2"
    assert show(*first, *second).is_driving
    assert show(*first, *second).room == "printer room 3"
    stopped = show(*first, *second, cancelled)
    assert (stopped.at, stopped.room, stopped.is_driving) == ((8.5, 3.0), "printer room 2", False)
    between = show(*first, *second, line("feedback", text="at (9.5, 3.0)"), cancelled)
    assert (between.room, between.sentence) == ("", "The robot is between rooms.")
    lost = show(call("go_to", location="printer room 2"), cancelled)
    assert (lost.at, lost.room) == (None, "")
    failed = line("error", number=2, skill="go_to", kind="E", message="m")
    assert show(*first, call("go_to", location="supply room"), failed).room == "printer room 2"
    seen = [call("is_in_room", entity="mug"), done("is_in_room", result=True)]
    finds = after(*first, call("go_to", location="supply room"), failed, *seen).finds
    assert finds == (Find("printer room 2", "mug"),)


def test_progress_shows_that_a_sleeping_program_waits() -> None:
    sleep = line("sleep", seconds=30.0, line=3)
    now = Progress().after(sleep)
    assert (now.doing, now.line) == ("waits for 30 s", 3)


def test_the_clock_stops_with_the_robot() -> None:
    stop, running = line("stop", 19.8, by="x"), line("state", 0.0, state="running")
    assert after(running, stop, line("state", 20.7, state="stopped")).clock == 19.8
    assert after(running, line("sleep", 1.0, seconds=9.0), line("state", 10.0, state="done")).clock == 10.0
    assert [
        after(*lines).has_begun for lines in ((), (line("state", state="checked"),), (running, stop))
    ] == [
        False,
        False,
        True,
    ]


def test_a_stop_is_one_event() -> None:
    drive, cancelled = call("go_to", location="supply room"), line("cancelled", number=1, skill="go_to")
    for events in (
        [drive, cancelled, line("stop", by="the page")],
        [drive, line("stop", by="the page"), cancelled],
    ):
        assert [moment.text for moment in after(*events).moments] == [
            'drives to "supply room"',
            "stopped from the page",
        ]
        states = [line("state", state=state, reason="stopped by x") for state in ("stopping", "stopped")]
        words = [text for _, text in timeline([line("state", state="drafting"), *events, *states])]
        assert words == ["mission created", 'drives to "supply room"', "stopped from the page"]


def test_progress_keeps_the_line_of_a_call() -> None:
    spoken = call("say", message="a")
    assert after(spoken).line is None
    assert after({**spoken, "line": 3}).line == 3


def test_a_robot_that_looks_for_ever_fills_no_memory() -> None:
    looks = [call("is_in_room", entity=" mug "), done("is_in_room", result=True)] * 200
    now = after(*looks, call("go_to", location="hall"), line("feedback", text=f"at ({'9' * 400}, 1)"))
    assert now.learned == (Event("check", "mug", found=True),) * _MAX_STEPS
    assert now.at is None


def test_only_the_last_moments_are_kept() -> None:
    assert (
        len(after(*[call("say", message=str(n)) for n in range(_MAX_MOMENTS + 50)]).moments) == _MAX_MOMENTS
    )


def test_a_floorplan_is_well_formed_whatever_rooms_are_called() -> None:
    names = ("<script>", 'a "quoted" & <b>bold</b> room', "\x1b\u202e\ud800", "x" * 5_000)
    world = World(tuple(map(Room, names)), names[0])
    met = {name: (name, "mug") for name in names}
    drawn = floorplan(
        world,
        MapState((1.0, 1.0), names[1], is_driving=True, trail=((0, 0), (1, 1)), finds=met, held=names[0]),
    )
    root = ET.fromstring(drawn.replace("<svg ", f'<svg xmlns="{SVG[1:-1]}" '))
    assert len(root.findall(f".//{SVG}polygon")) == 4
    assert {each.tag for each in root.iter()} == {
        SVG + tag for tag in ("svg", "polygon", "polyline", "text", "g", "circle")
    }
    assert len(root.findall(f".//{SVG}polygon[@class='room goal']")) == 1
    kinds = [each.get("class") for each in root.iter(f"{SVG}text")]
    assert kinds.count("find") == 8
    assert "held" in kinds
    assert drawn.encode()


@pytest.mark.slow
def test_a_floorplan_of_a_huge_building_stays_small() -> None:
    world = World(tuple(Room(f"room {n}") for n in range(5_000)), "room 0")
    assert floorplan(world, MapState()).count("<polygon") == MAX_DRAWN_ROOMS


def test_nothing_is_drawn_over_the_name_of_a_room() -> None:
    """The name is on the side farther from the robot, and is drawn after all else."""
    for stands, side in (((1.0, 3.5), max), ((1.0, 0.5), min)):
        room = Room("start_loc", footprint=((0, 0), (4, 0), (4, 4), (0, 4)), stand_at=stands)
        drawn = floorplan(World((room,), "start_loc"), MapState(stands, "start_loc", trail=((0, 0), stands)))
        (name,) = re.findall(r'<text class="name"[^>]* y="([\d.]+)"[^>]*>start_loc<', drawn)
        (robot,) = re.findall(r'class="body"[^>]* cy="([\d.]+)"', drawn)
        assert side(float(name), float(robot)) == float(name)
        assert abs(float(name) - float(robot)) > 0.62 + 0.34
        assert drawn.index("<text") > max(drawn.index("polyline"), drawn.index('class="body"'))
    state = MapState(room="start_loc", finds={"start_loc": ["ann"]}, held="mug")
    sentence = "The robot is in start_loc and is holding mug. Found in start_loc: ann."
    assert sentence in floorplan(World((Room("start_loc"),), "start_loc"), state)


def test_finds_in_a_large_room_do_not_cover_the_robot() -> None:
    world = read_world(OFFICE)
    at, room = (7.0, 3.0), "printer room 2"
    drawn = floorplan(world, MapState(at, room, trail=(at, at), finds={room: ["stapler"]}, held="paper"))
    (robot,) = re.findall(r'class="body"[^>]* cy="([\d.]+)"', drawn)
    (find,) = re.findall(r'<text class="find"[^>]* y="([\d.]+)"', drawn)
    (held,) = re.findall(r'<text class="held"[^>]* y="([\d.]+)"', drawn)
    names = [float(y) for y in re.findall(r'<text class="name"[^>]* y="([\d.]+)"[^>]*>printer<', drawn)]
    assert float(robot) + _HALO_RADIUS < float(held) < float(find) - 0.3 < min(names) - 0.3


def test_strips_show_each_kind_of_world_once() -> None:
    program = """def task_program():
    go_to("kitchen")
    if is_in_room("mug"):
        say("here it is")
    else:
        say("there is none")
"""
    found = check(program, rooms=["hall", "kitchen"])
    shown = strips(found)
    assert {strip.scenes[-1].deeds[-1] for strip in shown} == {
        Action("say", "here it is"),
        Action("say", "there is none"),
    }
    assert all([scene.room for scene in strip.scenes] == ["hall", "kitchen"] for strip in shown)
    assert all(strip.ends_well for strip in shown)


def test_a_question_is_drawn_with_its_options() -> None:
    asked = Event("ask", "Tea?", options=(Option("yes"), Option("no")), answer="no", place="hall")
    (scene,) = scenes(steps_of((asked,)), "hall")
    assert [deed.text for deed in scene.deeds] == ["Tea? [yes | no]", "no"]


def test_a_wait_is_drawn_in_the_room_where_the_robot_waits() -> None:
    program = "def task_program():\n    say('hi')\n    time.sleep(90)\n    go_to('kitchen')\n    say('bye')\n"
    (strip,) = strips(check(program, rooms=["hall", "kitchen"]))
    hall, kitchen = ([deed.text for deed in scene.deeds] for scene in strip.scenes)
    assert hall == ["hi", "waits for 90 s"]
    assert kitchen == ["bye"]


def test_usual_worlds_come_first() -> None:
    program = """def task_program():
    for room in get_all_rooms():
        go_to(room)
        if is_in_room("Lena"):
            say(f"Lena is in {room}.")
"""
    shown = strips(check(program, rooms=["hall", "kitchen", "lab", "den"]))
    found = [sum(deed.kind == "say" for scene in strip.scenes for deed in scene.deeds) for strip in shown]
    assert found == sorted(found, key=lambda number: max(number - 1, 0))
    assert found[0] <= 1 < found[-1], "Lena is in one room at most"


def test_a_long_run_is_shortened_once_even_if_many_steps_are_needed() -> None:
    trace = tuple(Event(kind, "mug", place="hall") for _ in range(250) for kind in ("check", "pick", "place"))
    steps = steps_of(trace)
    needed = {step["step"] for step in steps if step["kind"] != "check"}
    groups = [(is_shown, len(some)) for is_shown, some in select_steps(steps, needed)]
    assert [is_shown for is_shown, _ in groups if not is_shown] == [False]
    assert sum(size for is_shown, size in groups if is_shown) < 2 * MAX_SHOWN_STEPS


def test_only_the_repeated_step_in_its_room_is_marked() -> None:
    program = "def task_program():\n    say('hi')\n    go_to('kitchen')\n    say('hi')\n"
    found = check(program, rooms=["hall", "kitchen"])
    samples = [replace(one, repeated=one.outcome.trace[-1:]) for one in found.samples]
    shown = strips(replace(found, samples=tuple(samples)))
    marked = [[deed.is_repeated for deed in scene.deeds] for scene in shown[0].scenes]
    assert marked == [[False], [True]]


def test_wait_in_vain_is_harmless_unless_it_is_a_problem() -> None:
    wait = "def task_program():\n    while not is_in_room('mug'):\n        time.sleep(60)\n"
    found = check(wait, rooms=["hall"])
    number = next(one.number for one in found.samples if one.in_vain)
    assert all(strip.ends_well for strip in strips(found))
    assert found.vain_runs.startswith(
        f"in {sum(one.in_vain for one in found.samples)} of {len(found.samples)} "
    )
    problem = Problem("PickInvalidObject", "there is no mug", samples=(number,))
    shown = strips(replace(found, problems=(problem,)))
    assert [one.ends_well for one in shown] == [False, *[True] * (len(shown) - 1)]


@pytest.mark.parametrize(
    ("visited", "reached"),
    [
        ((), 0),
        (("kitchen",), 1),
        (("kitchen", "hall"), 2),
        (("kitchen", "hall", "attic", "attic"), 3),
        (("attic",), None),
        (("kitchen", "attic"), None),
    ],
)
def test_scenes_are_reached_in_order(visited: tuple[str, ...], reached: int | None) -> None:
    rooms = ("start_loc", "kitchen", "hall", _LEFT_OUT, "study")
    strip = Strip("", tuple(map(Scene, rooms)), "Done.", ends_well=True)
    assert scenes_reached(strip, visited, ()) == reached
    assert scenes_reached(Strip("", (Scene("hall"),), "Done.", ends_well=True), ("kitchen",), ()) is None


def test_a_find_rules_out_strips_without_it() -> None:
    program = "def task_program():\n    go_to('kitchen')\n    say('yes' if is_in_room('mug') else 'no')\n"
    shown = strips(check(program, rooms=["hall", "kitchen"]))
    assert len(shown) == 2
    said = {}
    for found in (True, False):
        looked = after(call("is_in_room", entity=" mug "), done("is_in_room", result=found)).learned
        possible = [one for one in shown if scenes_reached(one, ("kitchen",), looked)]
        said[found] = [one.scenes[-1].deeds[-1].text for one in possible]
    assert said == {True: ["yes"], False: ["no"]}


def test_a_look_rules_out_a_strip_whose_rest_is_left_out() -> None:
    program = "import time\n\ndef task_program():\n    while not is_in_room('mug'):\n        time.sleep(1)\n"
    boards = strips(check(program, rooms=["hall"]))
    shown = [one for one in boards if _LEFT_OUT in [scene.room for scene in one.scenes]]
    assert shown[0].scenes[-1].room == "hall", "after the steps that are left out, the room is named again"
    shown += [Strip("", (Scene("hall", (Action("check", "finds"),)), Scene(_LEFT_OUT)), "", ends_well=True)]
    looks = after(*(call("is_in_room", entity="mug"), done("is_in_room", result=False)) * 40).learned
    assert [scenes_reached(one, (), looks) for one in shown] == [0, None]


def test_an_answer_rules_out_strips_with_another() -> None:
    program = "def task_program():\n    go_to('kitchen')\n    ask('ann', 'Tea?', ['Yes', 'No'])\n"
    shown = strips(check(program, rooms=["hall", "kitchen"], samples=20))
    answers = [one.scenes[-1].deeds[-1].text for one in shown]
    assert sorted(answers) == ["No", "Yes"]

    def possible(*ends: dict[str, Any]) -> list[str]:
        asked = [call("ask", person="ann", question="Tea?", options=["Yes", "No"])] * bool(ends)
        learned = after(*asked, *ends).learned
        each = zip(answers, shown, strict=True)
        return [text for text, one in each if scenes_reached(one, ("kitchen",), learned) is not None]

    assert sorted(possible()) == ["No", "Yes"]
    assert possible(done("ask", result=" yes")) == ["Yes"]
    assert possible(line("error", number=1, skill="ask", kind="E", message="m")) == []


@pytest.mark.parametrize(
    ("program", "named"),
    [
        ("N = 2\n\ndef task_program():\n  go_to(\"x\")\n  say('y')\n", "typed: go_to(\"x\") say('y')"),
        ("go_to('not parsed')\n    )", "typed: go_to('not parsed') )"),
        (
            "def task_program():\n  say('a')\n# def task_program(): say('b')",
            "typed: say('a') # def task_program(): say('b')",
        ),
        ("def task_program():\n", "a program without an instruction"),
        ("", "a program without an instruction"),
    ],
)
def test_a_typed_program_is_named_by_its_first_steps(program: str, named: str) -> None:
    assert title(MissionSummary("id", MissionState.DONE, "simulated", 0.0, program=program)) == named
    assert (
        title(MissionSummary("id", MissionState.DONE, "simulated", 0.0, "Do it.", program=program))
        == "Do it."
    )


def test_strips_describe_their_worlds() -> None:
    program = """def task_program():
    go_to("kitchen")
    if is_in_room("mug"):
        say(ask("somebody", "Whose mug is it?", ["mine", "his"]))
"""
    worlds = {strip.world for strip in strips(check(program, rooms=["hall", "kitchen"]))}
    assert len(worlds) == 3
    assert all(world.startswith("If ") and '"mug"' in world for world in worlds)
    assert [world for world in worlds if "his" in world and "somebody" in world and "kitchen" in world]


def test_a_drive_to_nowhere_and_a_long_run_are_shown() -> None:
    (nowhere,) = strips(check("def task_program():\n    go_to('cellar')\n", rooms=["hall"]))
    assert (nowhere.scenes[-1].is_found, nowhere.ends_well) == (False, False)
    assert nowhere.ending == 'Fails: there is no room "cellar" (GoToInvalidLocation)'
    many = "def task_program():\n    for n in range(200):\n        say(str(n))\n"
    (long,) = strips(check(many, rooms=["hall"]))
    assert "182 more steps" in [deed.text for scene in long.scenes for deed in scene.deeds]
    assert len(strips(check(many, rooms=["hall"]))) <= MAX_STRIPS


def test_failing_strip_is_shown_first_even_from_the_last_of_many_worlds() -> None:
    looks = "".join(f"    if is_in_room('thing {n}'):\n        say('{n}')\n" for n in range(4))
    program = f"def task_program():\n{looks}    if is_in_room('key'):\n        go_to('cellar')\n"
    found = check(program, rooms=["hall"], samples=20)
    shown = strips(found)
    assert len(shown) == MAX_STRIPS
    assert [strip.ends_well for strip in shown] == [False, *[True] * (MAX_STRIPS - 1)]


def test_labels_of_a_room_do_not_cover_its_places() -> None:
    rooms = (Room("kitchen"), Room("sink", within="kitchen"), Room("fridge", within="kitchen"))
    drawn = floorplan(
        World(rooms, "kitchen"), MapState(finds={"kitchen": ["apple", "pear"], "sink": ["cup"]})
    )
    heights = {text: float(y) for y, text in re.findall(r'<text[^>]* y="([\d.]+)"[^>]*>([^<]*)<', drawn)}
    assert max(heights[name] for name in ("kitchen", "apple", "pear")) < min(heights["sink"], heights["cup"])
