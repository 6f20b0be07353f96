"""A service robot in a flat, which finds, counts, describes, follows, guides and fetches."""

from typing import Literal

from codebotler import PersonName, RoomName, Simulation, ThingName, skill

Extreme = Literal["biggest", "smallest", "heaviest", "lightest"]
NOBODY = {"PersonNotFound": "nobody in the room fits"}
LOST = NOBODY | {"PersonLost": "the person got lost on the way"}
STUCK = {"DoorStuck": "the door is stuck"}
CLOSED = {"ContainerClosed": "it is closed", "NotInside": "it is not inside"}
LOOKS = {"pose": ("sitting", "standing", "lying", "waving"), "clothes": ("red coat", "blue shirt")}


@skill(verb="find {description}", fails=NOBODY, example='find_person("waving person")')
def find_person(sim: Simulation, description: str) -> PersonName:
    """Find a person in this room who fits a description, and return their name."""
    found = sim.people(sim.room, is_=description)
    return PersonName(found[0]) if found else sim.fail("PersonNotFound")


@skill(verb="find each {description}", example='find_things("red fruit")')
def find_things(sim: Simulation, description: str) -> list[ThingName]:
    """List the things in this room, or at this place, that fit a description."""
    return [ThingName(name) for name in sim.things(sim.room, is_=description)]


@skill(verb="count {description}", example='count_people("sitting people")')
def count_people(sim: Simulation, description: str) -> int:
    """Count the people in this room who fit a description."""
    return len(sim.people(sim.room, is_=description))


@skill(verb="look at the {what} of {person}", fails=NOBODY, example='describe("Angel", "pose")')
def describe(sim: Simulation, person: str, what: Literal["pose", "clothes"]) -> str:
    """Describe the pose or the clothes of a person in this room."""
    found = sim.people(sim.room, is_=person)
    if not found:
        sim.fail("PersonNotFound")
    seen = sim.traits(found[0]).get("wears" if what == "clothes" else what)
    return seen or str(sim.value(f"{what} of {found[0]}", *LOOKS[what]))


@skill(verb="find the {which} {kind}", fails={"NothingFits": "nothing here fits"}, text="kind")
def find_extreme(sim: Simulation, kind: str, which: Extreme) -> ThingName:
    """Find the biggest, smallest, heaviest or lightest thing of a kind in this room, or at this place."""
    measure = "size" if which in {"biggest", "smallest"} else "weight"
    sizes = {name: sim.traits(name).get(measure, 0) for name in sim.things(sim.room, is_=kind)}
    choose = max if which in {"biggest", "heaviest"} else min
    return ThingName(choose(sizes, key=lambda name: sizes[name])) if sizes else sim.fail("NothingFits")


@skill(verb="follow {person}", fails=LOST, seconds=30)
def follow(sim: Simulation, person: str) -> RoomName:
    """Follow a person in this room until they stop, and return the name of the room where they stop."""
    found = sim.people(sim.room, is_=person) or sim.fail("PersonNotFound")
    if sim.truth(f"{found[0]} gets lost"):
        sim.fail("PersonLost")
    room = str(sim.value(f"{found[0]} walks to", *sim.rooms))
    sim.move_person(found[0], room)
    sim.drive(room)
    return RoomName(room)


@skill(verb="guide {person} to {room}", fails=LOST, seconds=30, example='guide("Angel", "bathroom")')
def guide(sim: Simulation, person: str, room: str) -> None:
    """Guide a person in this room to another room."""
    found = sim.people(sim.room, is_=person) or sim.fail("PersonNotFound")
    if sim.truth(f"{found[0]} gets lost"):
        sim.fail("PersonLost")
    sim.drive(room)
    sim.move_person(found[0], room)


@skill(verb="hand {thing} to {person}", fails=NOBODY, example='hand_over("apple", "Angel")')
def hand_over(sim: Simulation, thing: str, person: str) -> None:
    """Hand the thing that the robot holds to a person in this room."""
    if not sim.people(sim.room, is_=person):
        sim.fail("PersonNotFound")
    sim.put(thing)


@skill(verb="open {door}", fails=STUCK, when_tried=False, example='open_door("fridge")')
def open_door(sim: Simulation, door: str) -> None:
    """Open a door in this room, such as that of the fridge."""
    if sim.truth(f"{door} is stuck"):
        sim.fail("DoorStuck")
    sim.state[door] = "open"


@skill(
    verb="close {door}", fails={"DoorNotOpen": "the robot has not opened it"}, example='close_door("fridge")'
)
def close_door(sim: Simulation, door: str) -> None:
    """Close a door that the robot has opened."""
    if sim.state.pop(door, None) is None:
        sim.fail("DoorNotOpen")


@skill(verb="take {thing} out of {container}", fails=CLOSED, example='take_out("milk", "fridge")')
def take_out(sim: Simulation, thing: str, container: str) -> None:
    """Take a thing out of a container in this room whose door the robot has opened."""
    if container not in sim.state:
        sim.fail("ContainerClosed")
    if not sim.things(container, is_=thing):
        sim.fail("NotInside")
    sim.take(thing)


@skill(verb="greet {person}", fails=NOBODY, example='greet("Angel")')
def greet(sim: Simulation, person: str) -> None:
    """Turn to a person in this room, and greet them by this name."""
    if not sim.people(sim.room, is_=person):
        sim.fail("PersonNotFound")
