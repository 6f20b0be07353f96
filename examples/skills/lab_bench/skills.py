"""A bench that pipettes."""

from enum import Enum

from codebotler import Simulation, skill


class Reagent(Enum):
    """What stands on the bench."""

    WATER = "water"
    ETHANOL = "ethanol"
    BUFFER = "buffer"


WELLS = {f"{row}{column}" for row in "ABCDEFGH" for column in range(1, 13)}
DRAWING = {"NoTip": "there is no tip on the pipette", "TooMuch": "more than 200 microlitres are asked for"}
FILLING = {"TipEmpty": "there is nothing in the tip", "NoSuchWell": "the plate has wells A1 to H12 only"}


@skill(verb="attach a new tip", seconds=2, ros="bench_msgs/NewTip:/new_tip")
def new_tip(sim: Simulation) -> None:
    """Throw the tip away, and attach a new one."""
    sim.state.update(tip=True, inside=None)


@skill(verb="aspirate {microlitres} µl of {reagent}", fails=DRAWING, ros="bench_msgs/Aspirate:/aspirate")
def aspirate(sim: Simulation, reagent: Reagent, microlitres: float) -> None:
    """Draw up to 200 microlitres of a reagent into the tip."""
    if not sim.state.get("tip"):
        sim.fail("NoTip")
    if microlitres > 200:
        sim.fail("TooMuch")
    sim.state["inside"] = reagent


@skill(verb="dispense into {well}", fails=FILLING, ros="bench_msgs/Dispense:/dispense")
def dispense(sim: Simulation, well: str) -> None:
    """Empty the tip into a well of the plate, such as A1."""
    if sim.state.get("inside") is None:
        sim.fail("TipEmpty")
    if well not in WELLS:
        sim.fail("NoSuchWell")
    sim.state["inside"] = None
