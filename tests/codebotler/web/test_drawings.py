"""What pages draw: how far a mission has come, the rooms, and what a robot would do."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import pytest

from codebotler.checker import check
from codebotler.web.floorplan import MOST_ROOMS, floorplan
from codebotler.web.progress import MOST, Moment, Progress, line_of
from codebotler.web.strip import MOST_STRIPS, Deed, strips
from codebotler.world import Room, World

PROGRAM = """def task_program():
    for room in get_all_rooms():
        go_to(room)
    go_to("kitchen")
    say("hello")
    say("hello")
    ask("ann", "tea?", ["yes", "no"])
"""
SVG = "{http://www.w3.org/2000/svg}"


def line(event: str, clock: float = 1.0, **data: Any) -> dict[str, Any]:  # noqa: ANN401 - JSON
    return {"time": 0.0, "clock": clock, "event": event, **data}


def call(skill: str, **arguments: object) -> dict[str, Any]:
    return line("skill", number=1, skill=skill, arguments=arguments)


def after(*lines: dict[str, Any]) -> Progress:
    progress = Progress()
    for each in lines:
        progress = progress.after(each, PROGRAM)
    return progress


@pytest.mark.parametrize(
    ("skill", "given", "where"),
    [
        ("go_to", ["kitchen"], None),  # either of two calls
        ("go_to", ["study"], 3),
        ("say", ["hello"], None),
        ("ask", ["ann", "tea?", ("yes", "no")], 7),
        ("pick", ["mug"], None),
    ],
)
def test_a_line_is_named_only_where_no_other_can_be_meant(
    skill: str, given: list[object], where: int | None
) -> None:
    assert line_of(PROGRAM, skill, given) == where
    assert line_of("no program (", skill, given) is None


def test_progress_tells_what_goes_on_and_where() -> None:
    driving = after(call("go_to", location="study"), line("feedback", text="at (1.5, -2.0)"))
    assert (driving.doing, driving.room, driving.at) == ('drives to "study"', "study", (1.5, -2.0))
    assert driving.is_driving
    there = driving.after(line("result", number=1, skill="go_to", result=None), PROGRAM)
    assert (there.doing, there.skill, there.is_driving, there.room) == ("", "", False, "study")


def test_what_is_spoken_is_told_apart() -> None:
    asked = after(
        call("ask", person="ann", question="tea?", options=["yes", "no"]),
        line("result", number=1, skill="ask", result="yes"),
        call("say", message="fine"),
    )
    assert asked.moments == (
        Moment(1.0, "asks", "tea? [yes | no]"),
        Moment(1.0, "hears", "yes"),
        Moment(1.0, "says", "fine"),
    )


def test_only_the_last_moments_are_kept() -> None:
    assert len(after(*[call("say", message=str(n)) for n in range(MOST + 50)]).moments) == MOST


def test_a_floorplan_is_well_formed_whatever_rooms_are_called() -> None:
    names = ("<script>", 'a "quoted" & <b>bold</b> room', "\x1b\u202e\ud800", "x" * 5_000)
    world = World(tuple(map(Room, names)), names[0])
    drawn = floorplan(world, (1.0, 1.0), names[1])
    root = ET.fromstring(drawn.replace("<svg ", f'<svg xmlns="{SVG[1:-1]}" '))
    assert len(root.findall(f".//{SVG}polygon")) == 4
    assert {each.tag for each in root.iter()} == {
        SVG + tag for tag in ("svg", "polygon", "text", "g", "circle")
    }
    assert len(root.findall(f".//{SVG}polygon[@class='room here']")) == 1
    assert drawn.encode()


def test_a_floorplan_of_a_huge_building_stays_small() -> None:
    world = World(tuple(Room(f"room {n}") for n in range(5_000)), "room 0")
    assert floorplan(world).count("<polygon") == MOST_ROOMS


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
        Deed("say", "here it is"),
        Deed("say", "there is none"),
    }
    assert all([scene.room for scene in strip.scenes] == ["hall", "kitchen"] for strip in shown)
    assert all(strip.ends_well for strip in shown)


def test_a_drive_to_nowhere_and_a_long_run_are_shown() -> None:
    (nowhere,) = strips(check("def task_program():\n    go_to('cellar')\n", rooms=["hall"]))
    assert (nowhere.scenes[-1].is_found, nowhere.ends_well) == (False, False)
    assert nowhere.ending.startswith("GoToInvalidLocation")
    many = "def task_program():\n    for n in range(200):\n        say(str(n))\n"
    (long,) = strips(check(many, rooms=["hall"]))
    assert "182 more steps" in [deed.text for scene in long.scenes for deed in scene.deeds]
    assert len(strips(check(many, rooms=["hall"]))) <= MOST_STRIPS
