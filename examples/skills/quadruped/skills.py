"""A four-legged robot that opens doors, climbs stairs and reads gauges."""

from codebotler import Simulation, skill

OPENS, LOCKED = ("it did not move", "it opened"), {"DoorLocked": "the door is locked"}


@skill(verb="open {door}", results=OPENS, fails=LOCKED, ros="lab_msgs/OpenDoor:/open_door")
def open_door(sim: Simulation, door: str) -> bool:
    """Open a door of the room; False if it did not move."""
    if sim.truth(f"{door} is locked"):
        sim.fail("DoorLocked")
    return sim.truth(f"{door} opens")


@skill(verb="climb {stairs}", fails={"StairsBlocked": "something stands on the stairs"}, seconds=10)
def climb(sim: Simulation, stairs: str) -> None:
    """Climb stairs of the room, up or down."""


@skill(verb="read {gauge}", ros="lab_msgs/ReadGauge:/read_gauge")
def read_gauge(sim: Simulation, gauge: str) -> float:
    """Read a gauge in the room, in bar."""
