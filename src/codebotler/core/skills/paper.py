"""The eight skills of the paper (figure 2a), declared like any other."""

from __future__ import annotations

from codebotler.core.skills.declaration import skill
from codebotler.core.skills.kinds import CHECK, GOTO, SAY
from codebotler.core.skills.simulation import Simulation
from codebotler.core.skills.table import RosAction, SkillTable
from codebotler.core.skills.verbs import Verb


def _verb(base: str, rest: str) -> Verb:
    return Verb(f"{base} {rest}", f"{base}s {rest}", f"{base}ed {rest}", f"{base}ing {rest}")


@skill(
    verb=_verb("look", "up where it is"),
    event=None,
    seconds=0.0,
    ros=RosAction("GetCurrentLocation", "/get_current_location_server", result="string"),
    is_idle=True,
)
def get_current_location(sim: Simulation) -> str:
    """Name the room the robot is in."""
    return sim.room


@skill(
    verb=_verb("look", "up which rooms there are"),
    event=None,
    seconds=0.0,
    ros=RosAction("GetAllRooms", "/get_all_rooms_server", result="string[]"),
    is_idle=True,
)
def get_all_rooms(sim: Simulation) -> list[str]:
    """List the names of all rooms."""
    return list(sim.rooms)


@skill(
    verb=Verb(
        *("look for", "looks for", "looked for", "looking for", "looked around"),
        results=("not found", "found"),
    ),
    event=CHECK,
    when_tried=False,
    adds_event=False,
    names="object or person",
    ros=RosAction("IsInRoom", "/is_in_room_server", ("string object",), "bool"),
    seconds=1.0,
    is_idle=True,
)
def is_in_room(sim: Simulation, entity: str) -> bool:
    """Look whether an object or a person is in the room the robot is in."""
    return sim.look(entity)


@skill(
    verb=Verb("go to", "drives to", "went to", "going to"),
    event=GOTO,
    names="room",
    when_tried=True,
    adds_event=False,
    seconds=0.0,
    ros=RosAction("GoTo", "/go_to_server", ("string location",), failure="GoToInvalidLocation"),
)
def go_to(sim: Simulation, location: str) -> None:
    """Drive to a room."""
    sim.drive(location)


@skill(
    verb=Verb("ask", "asks", "asked", "asking", "asked something"),
    text="question",
    names="",
    adds_event=False,
    to="person",
    when_tried=True,
    ros=RosAction("Ask", "/ask_server", ("string person", "string question", "string[] options"), "string"),
    seconds=3.0,
)
def ask(sim: Simulation, person: str, question: str, options: list[str]) -> str:
    """Ask a person in the same room a question and return the option that they choose."""
    chosen: str = sim.ask(person, question, options)  # by its position, since options may look alike
    return chosen


@skill(
    verb=Verb("say", "says", "said", "saying", "spoke"),
    names="",
    adds_event=False,
    when_tried=True,
    ros=RosAction("Say", "/say_server", ("string message",)),
    seconds=1.0,
    is_idle=True,
)
def say(sim: Simulation, message: str) -> None:
    """Say a message aloud in the room the robot is in."""
    sim.record(SAY, message)


@skill(
    verb=Verb("pick up", "picks up", "picked up", "picking up", "picked something up"),
    names="object",
    when_tried=False,
    adds_event=False,
    ros=RosAction("Pick", "/pick_server", ("string obj",)),
    seconds=5.0,
)
def pick(sim: Simulation, obj: str) -> None:
    """Pick up an object in the room; the robot can hold one at a time."""
    sim.take(obj)


@skill(
    verb=Verb("put down", "puts down", "put down", "putting down", "put something down"),
    names="object",
    when_tried=False,
    adds_event=False,
    ros=RosAction("Place", "/place_server", ("string obj",), failure="PlaceNoObject"),
    seconds=3.0,
)
def place(sim: Simulation, obj: str) -> None:
    """Put down the object that the robot holds."""
    sim.put(obj)


SKILLS = SkillTable((get_current_location, get_all_rooms, is_in_room, go_to, ask, say, pick, place))
"""The eight skills of the paper."""
