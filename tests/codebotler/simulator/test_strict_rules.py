"""Stricter settings of a suite: whole words, own names, events as they happened, people who leave."""

from pathlib import Path

import pytest

from codebotler.core.errors import RobotError, UserError
from codebotler.core.trace import Option, Status
from codebotler.core.world import Person, Room, World
from codebotler.core.world_file import read_world
from codebotler.simulator.engine import run
from codebotler.simulator.settings import PAPER_SETTINGS, SimulationSettings, choose
from codebotler.simulator.worlds.matching import WORDS_FOR_PEOPLE, resolve_room
from codebotler.simulator.worlds.robot import SimulatedRobot
from roboeval.suites.schema import SimulationFile

pytestmark = pytest.mark.shared_engine

STRICT = SimulationSettings(
    literals="as-written",
    matching="whole-words",
    people="own-name-or-word",
    words_for_people=("person", "someone"),
    events="as-happened",
)
YES_NO = (Option("I don't know"), Option("no"), Option("yes"))
WORLD = World(
    (
        Room("room 1", ("mug", "stapler"), (Person("kim", ("no",)),)),
        Room("room 12", ("bottle",), (Person("lou", (-1,)), Person("guest|visitor", ("yes",)))),
        Room("hall"),
    ),
    "hall",
)


def robot(world: World = WORLD, settings: SimulationSettings = STRICT) -> SimulatedRobot:
    return SimulatedRobot(world, settings)


def test_rooms_match_whole_words_and_drives_are_recorded_by_their_destination() -> None:
    one = robot()
    one.perform("go_to", ["Room 12 or perhaps room 1"])
    one.perform("go_to", ["the room 12"])
    with pytest.raises(RobotError, match="no room"):
        one.perform("go_to", ["room 123"])
    assert [(event.kind, event.text) for event in one.trace] == [("goto", "room 1"), ("goto", "room 12")]
    assert resolve_room(("lab", "lab 2"), "lab 2", "whole-words") == "lab 2"
    loose = robot(settings=PAPER_SETTINGS)
    loose.perform("go_to", ["room 123"])
    assert (loose.room, loose.trace[0].text) == ("room 1", "room 123")


def test_words_for_people_have_a_default() -> None:
    settings = SimulationFile.model_validate({"people": "own-name-or-word"}).settings()
    assert robot(settings=settings).settings.words_for_people == WORDS_FOR_PEOPLE
    assert SimulationFile.model_validate(
        {"people": "own-name-or-word", "words_for_people": ["dog"]}
    ).settings() == SimulationSettings(people="own-name-or-word", words_for_people=("dog",))
    assert SimulationFile().settings() == PAPER_SETTINGS


WORDS = SimulationSettings(
    matching="whole-words",
    words_for_yes=("sure", "love to", "i am", "i do"),
    words_for_no=("not", r"\w+n['\u2019]t", "another time", "busy", "decline"),
)


@pytest.mark.parametrize(
    ("options", "by_yes", "by_no"),
    [
        (("Sure", "No thanks"), 0, 1),
        (("No, sorry", "Of course"), 1, 0),
        (("I'd love to", "Maybe another time"), 0, 1),
        (("Yes", "Not today"), 0, 1),
        (("Accept", "Decline"), 0, 1),
        (("hot", "not hot"), 0, 1),
        (("I don\u2019t have mail", "I have mail"), 1, 0),
        (("I do not", "I do"), 1, 0),
        (("Maybe", "Sure", "I am busy"), 1, 2),
        (("Yes, please", "Sure", "No"), 0, 2),
        (("red", "green"), None, None),
        (("one", "two", "not at all"), None, 2),
    ],
)
def test_other_words_for_yes_and_no_are_understood(
    options: tuple[str, ...], by_yes: int | None, by_no: int | None
) -> None:
    offered = tuple(map(Option, options))
    assert [choose(answer, "Tea?", offered, WORDS) for answer in ("yes", "no")] == [by_yes, by_no]


def test_person_who_wants_something_agrees_to_it_in_other_words() -> None:
    offered = (Option("Sure"), Option("No, let me choose again"))
    assert [choose("tea", f"So that is {drink}?", offered, WORDS) for drink in ("tea", "water")] == [0, 1]
    assert choose("tea", "So that is tea?", offered, STRICT) is None
    assert choose("tea", "So what is it?", (Option("water"), Option("milk")), WORDS) is None


def test_without_other_words_only_yes_agrees() -> None:
    offered = (Option("Sure"), Option("No thanks"))
    assert [choose(answer, "Tea?", offered, STRICT) for answer in ("yes", "no")] == [1, 1]


@pytest.mark.parametrize(
    ("entity", "strict", "loose"),
    [
        ("kim", True, True),
        ("Kim's friend", True, True),
        ("a person", True, True),
        ("persons", True, True),
        ("personality", False, True),
        ("unicorn", False, True),
        ("lou", False, True),
        ("staplers", True, True),
        ("smug", False, True),
    ],
)
def test_people_are_found_by_their_own_name_or_a_word_for_people(
    entity: str,
    strict: bool,  # noqa: FBT001 - a parameter of the test
    loose: bool,  # noqa: FBT001 - a parameter of the test
) -> None:
    for settings, seen in ((STRICT, strict), (PAPER_SETTINGS, loose)):
        one = robot(settings=settings)
        one.perform("go_to", ["room 1"])
        assert one.perform("is_in_room", [entity]) is seen


def test_question_reaches_the_person_that_it_means() -> None:
    one = robot()
    one.perform("go_to", ["room 12"])
    assert one.perform("ask", ["visitor", "Tea?", YES_NO]) == 2
    assert one.perform("ask", ["lou", "Tea?", YES_NO[:2]]) == 1  # the last option
    assert one.perform("ask", ["", "Tea?", YES_NO]) == 2
    with pytest.raises(RobotError, match="nobody is in"):
        one.perform("ask", ["kim", "Tea?", YES_NO])


def test_answers_are_whole_words() -> None:
    one, loose = robot(), robot(settings=PAPER_SETTINGS)
    for each, chosen in ((one, 1), (loose, 0)):
        each.perform("go_to", ["room 1"])
        assert each.perform("ask", ["kim", "Tea?", YES_NO]) == chosen


def test_thing_can_be_picked_and_placed_by_other_names() -> None:
    one = robot()
    one.perform("go_to", ["room 1"])
    one.perform("pick", ["the old stapler"])
    with pytest.raises(RobotError, match="cannot place"):
        one.perform("place", ["mug"])
    one.perform("place", ["stapler"])
    assert [(event.kind, event.text) for event in one.trace[1:]] == [
        ("pick", "stapler"),
        ("place", "stapler"),
    ]
    one.perform("pick", ["stapler"])


def test_person_has_a_separate_answer_for_each_topic() -> None:
    knows = Person("kim", (1,), (("bread", "no"), ("cheese", "yes")))
    one = robot(World((Room("hall", people=(knows,)),), "hall"))
    options = (Option("Yes"), Option("No"))
    assert one.perform("ask", ["kim", "Have you any bread?", options]) == 1
    assert one.perform("ask", ["kim", "And cheese?", options]) == 0
    assert one.perform("ask", ["kim", "And a pan?", options]) == 0


def test_people_come_after_looks_in_vain_and_leave_when_asked() -> None:
    people = (
        Person("kim", ("yes",), leaves=True),
        Person("lou", ("no", "yes"), after_looks=2, leaves=True),
    )
    one = robot(World((Room("hall", people=people),), "hall"))
    assert one.perform("is_in_room", ["lou"]) is False
    assert one.perform("ask", ["", "Tea?", YES_NO]) == 2
    assert [one.perform("is_in_room", ["person"]) for _ in range(4)] == [False, False, True, True]
    assert [one.perform("ask", ["lou", "Tea?", YES_NO]) for _ in range(2)] == [1, 2]
    assert one.perform("is_in_room", ["person"]) is False
    with pytest.raises(RobotError, match="nobody is in"):
        one.perform("ask", ["", "Tea?", YES_NO])


WAITS_FOR_A_PERSON = """
def task_program():
    looks = 1
    while not is_in_room("person"):
        looks += 1
        time.sleep(10)
    say(str(looks))
"""


def test_waiting_program_meets_the_person_who_comes() -> None:
    world = World((Room("hall", people=(Person("kim", after_looks=5),)),), "hall")
    (outcome,) = run([(WAITS_FOR_A_PERSON, world)], workers=1, settings=STRICT)
    assert outcome.status is Status.FINISHED
    assert outcome.trace[-1].text == "6"


FILE = """\
about: everybody
robot: hall
rooms: [hall]
people:
  hall:
  - name: kim
    answers: ['yes', {option: -1}]
    topics: {tea: 'no', cake: {option: 2}}
    after_looks: 3
    leaves: true
"""


def test_people_survive_the_round_trip_through_a_world_file(tmp_path: Path) -> None:
    path = tmp_path / "world.yaml"
    path.write_text(FILE)
    world = read_world(path)
    assert world.rooms[0].people == (
        Person("kim", ("yes", -1), (("tea", "no"), ("cake", 2)), 3, leaves=True),
    )
    path.write_text(world.to_yaml())
    assert read_world(path) == world


@pytest.mark.parametrize(
    ("good", "bad", "problem"),
    [
        ("option: 2", "option: 0", "there is no option 0"),
        ("tea:", "'(':", "not a valid regular expression"),
        ("tea:", "(a+)+$:", "line 8: "),
        ("name: kim", "name: (a+)+$", "may take too long"),
        ("['yes',", "['(a|aa)+$',", "line 7: "),
        ("tea:", "'(?#cup)(?i)tea':", "global flags"),  # Python accepts it only outside another regex
        ("after_looks: 3", "after_looks: -3", "line 9"),
    ],
)
def test_mistake_in_a_world_file_is_an_error_that_names_it(
    tmp_path: Path, good: str, bad: str, problem: str
) -> None:
    path = tmp_path / "world.yaml"
    path.write_text(FILE.replace(good, bad))
    with pytest.raises(UserError) as error:
        read_world(path)
    assert problem in str(error.value)
