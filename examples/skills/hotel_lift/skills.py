"""A hotel's robot that takes the lift."""

from codebotler import Simulation, skill

COMES, OPENS = ("it does not come", "it comes"), ("nobody opens", "somebody opens")
FAILS = {"LiftNotHere": "the lift was not called, or did not come", "NoSuchFloor": "the floors are 0 to 5"}


@skill(verb="call the lift", results=COMES, ros="hotel_msgs/CallLift:/call_lift")
def call_lift(sim: Simulation) -> bool:
    """Call the lift to this floor; False if it does not come."""
    comes = sim.truth("the lift comes")
    sim.state["open"] = comes
    return comes


@skill(verb="ride to floor {floor}", fails=FAILS, seconds=20, ros="hotel_msgs/RideTo:/ride_to")
def ride_to(sim: Simulation, floor: int) -> None:
    """Ride to a floor from 0 to 5, in the lift that was called before."""
    if not 0 <= floor <= 5:
        sim.fail("NoSuchFloor")
    if not sim.state.pop("open", False):
        sim.fail("LiftNotHere")


@skill(verb="knock at room {room}", results=OPENS, ros="hotel_msgs/Knock:/knock")
def knock(sim: Simulation, room: int) -> bool:
    """Knock at the door of a room; True if somebody opens."""
