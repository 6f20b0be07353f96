import copy
import inspect
import pickle
from dataclasses import replace

import pytest

from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.simulation import Simulation
from codebotler.core.skills.table import Parameter, Recording, Skill, SkillTable
from codebotler.core.skills.values import NO_VALUE, TEXT_TYPE
from codebotler.simulator.worlds.robot import SimulatedRobot
from codebotler.simulator.worlds.sampled_robot import SampledRobot


def test_skill_signatures_are_those_of_the_paper() -> None:
    assert [skill.signature for skill in SKILLS.values()] == [
        "get_current_location() -> str",
        "get_all_rooms() -> list[str]",
        "is_in_room(entity: str) -> bool",
        "go_to(location: str) -> None",
        "ask(person: str, question: str, options: list[str]) -> str",
        "say(message: str) -> None",
        "pick(obj: str) -> None",
        "place(obj: str) -> None",
    ]


def test_six_skills_are_recorded_as_events() -> None:
    assert {kind: (row.text, row.options) for kind, row in SKILLS.recordings.items()} == {
        "check": ("entity", None),
        "goto": ("location", None),
        "ask": ("question", "options"),
        "say": ("message", None),
        "pick": ("obj", None),
        "place": ("obj", None),
    }


def test_texts_and_options_of_events_are_parameters_of_their_skills() -> None:
    for skill in SKILLS.values():
        if skill.recording is not None:
            types = {parameter.name: parameter.type for parameter in skill.parameters}
            assert types[skill.recording.text] == TEXT_TYPE
            assert skill.recording.options is None or types[skill.recording.options].is_list


def test_every_skill_has_a_ros_action_with_one_goal_field_per_parameter() -> None:
    for skill in SKILLS.values():
        assert skill.ros is not None
        assert [field.split()[-1] for field in skill.ros.goal] == [
            {"entity": "object"}.get(p.name, p.name) for p in skill.parameters
        ]
        assert (skill.ros.result is None) == (skill.returns == NO_VALUE)
        assert skill.ros.server == f"/{skill.name}_server"


def test_simulated_robots_implement_the_interface_that_skills_use() -> None:
    """Nothing else compares the two: skills accept any object as a robot."""
    for kind in (SimulatedRobot, SampledRobot):
        for name, asked in inspect.getmembers(Simulation, inspect.isfunction):
            if not name.startswith("_"):
                wanted = [*inspect.signature(asked).parameters]
                assert [*inspect.signature(getattr(kind, name)).parameters][: len(wanted)] == wanted


WAVE = Skill("wave", (Parameter("person"),), NO_VALUE, "Wave.", Recording("wave", "person"))


def test_with_skill_returns_a_longer_table_and_keeps_the_old_one() -> None:
    more = SKILLS.with_skill(WAVE)
    assert list(more) == [*SKILLS, "wave"]
    assert more["wave"] is WAVE
    assert (len(more), len(SKILLS)) == (9, 8)
    assert more != SKILLS
    assert more == SKILLS.with_skill(WAVE)
    assert hash(more) == hash(SKILLS.with_skill(WAVE))


@pytest.mark.parametrize(
    "row",
    [
        Skill("say", (), NO_VALUE, "Another skill of that name."),
        Skill("shout", (Parameter("text"),), NO_VALUE, "Another of that kind.", Recording("say", "text")),
    ],
)
def test_second_skill_with_a_known_name_or_event_kind_is_refused(row: Skill) -> None:
    with pytest.raises(ValueError, match="two skills"):
        SKILLS.with_skill(row)


def test_table_knows_only_its_rows() -> None:
    with pytest.raises(KeyError):
        SkillTable((WAVE,))["say"]


def test_skills_can_be_pickled_and_copied() -> None:
    assert pickle.loads(pickle.dumps(SKILLS["go_to"])) is SKILLS["go_to"]
    assert copy.deepcopy(SKILLS["go_to"]) is SKILLS["go_to"]
    assert pickle.loads(pickle.dumps(SKILLS)) == SKILLS
    assert pickle.loads(pickle.dumps(WAVE)) == WAVE
    assert pickle.loads(pickle.dumps(replace(WAVE, does=print))).does is print


def test_idle_lists_the_skills_that_change_nothing() -> None:
    assert SKILLS.idle == {"get_current_location", "get_all_rooms", "is_in_room", "say"}
