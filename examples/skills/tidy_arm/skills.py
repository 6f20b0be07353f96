"""An arm that tidies things into receptacles."""

from typing import Literal

from codebotler import Simulation, skill

FAILS = {"ReceptacleClosed": "the drawer is closed", "ReceptacleFull": "there is no room left in it"}


@skill(verb="open {receptacle}", ros="lab_msgs/OpenReceptacle:/open_receptacle")
def open_receptacle(sim: Simulation, receptacle: Literal["drawer", "shelf", "bin"]) -> None:
    """Open a receptacle; a shelf and a bin are always open."""
    sim.state[receptacle] = "open"


@skill(verb="put {item} into the {receptacle}", fails=FAILS, ros="lab_msgs/Tidy:/tidy")
def tidy(sim: Simulation, item: str, receptacle: Literal["drawer", "shelf", "bin"]) -> None:
    """Take a thing from the table and put it into a receptacle; a drawer must have been opened."""
    if receptacle == "drawer" and "drawer" not in sim.state:
        sim.fail("ReceptacleClosed")
    if sim.truth(f"the {receptacle} is full"):
        sim.fail("ReceptacleFull")


@skill(verb="look at the table", ros="lab_msgs/SeenOnTable:/seen_on_table")
def seen_on_table(sim: Simulation) -> list[Literal["cup", "spoon", "can", "pen"]]:
    """List what lies on the table."""
