"""A drone that flies over a site and takes photographs."""

from codebotler import Simulation, skill

TOO_WINDY = {"TooWindy": "it is too windy"}
ON_THE_GROUND = {"NotFlying": "the drone is on the ground"}


# In too much wind, the drone does not even start, so a failed attempt does not count.
@skill(verb="take off", fails=TOO_WINDY, when_tried=False, seconds=5, ros="drone_msgs/TakeOff:/take_off")
def take_off(sim: Simulation) -> None:
    """Take off; needed before all else."""
    if sim.truth("it is too windy"):
        sim.fail("TooWindy")
    sim.state["flies"] = True


@skill(
    verb="take {shots} photographs of {subject}", fails=ON_THE_GROUND, ros="drone_msgs/Photograph:/photograph"
)
def photograph(sim: Simulation, subject: str, shots: int) -> int:
    """Photograph something from the air; return how many of the shots are sharp."""
    if not sim.state.get("flies"):
        sim.fail("NotFlying")
    return shots if sim.truth(f"{subject} is well lit") else 0


@skill(verb="land", fails=ON_THE_GROUND, seconds=5, ros="drone_msgs/Land:/land")
def land(sim: Simulation) -> None:
    """Land."""
    if not sim.state.pop("flies", False):
        sim.fail("NotFlying")
