"""Skills of a robot that works in a household, for the rules in `examples/rules/household.yaml`."""

from codebotler import Simulation, skill


@skill(verb="turn on {device}", sets="on", example='turn_on("stove")')
def turn_on(sim: Simulation, device: str) -> None:
    """Turn on a device."""


@skill(verb="turn off {device}", clears="on", example='turn_off("stove")')
def turn_off(sim: Simulation, device: str) -> None:
    """Turn off a device."""


@skill(verb="open {door}", sets="open", example='open_door("fridge")')
def open_door(sim: Simulation, door: str) -> None:
    """Open the door of a room or a device."""


@skill(verb="close {door}", clears="open", example='close_door("fridge")')
def close_door(sim: Simulation, door: str) -> None:
    """Close the door of a room or a device."""


@skill(verb="take {thing} from {place}", example='take("apple", "fridge")')
def take(sim: Simulation, thing: str, place: str) -> None:
    """Take a thing from a place in this room, such as the table or the floor."""


@skill(verb="put {thing} on or into {place}", example='put("apple", "table")')
def put(sim: Simulation, thing: str, place: str) -> None:
    """Put a thing on or into a place, a device or a vessel in this room."""


@skill(verb="pour {liquid} into or onto {target}", example='pour("water", "kettle")')
def pour(sim: Simulation, liquid: str, target: str) -> None:
    """Pour a liquid into a vessel or onto a thing."""


@skill(verb="heat {thing} in {device}", example='heat("soup", "microwave")')
def heat(sim: Simulation, thing: str, device: str) -> None:
    """Heat a thing in a device, and turn the device off afterwards."""


@skill(verb="rinse {thing}", example='rinse("bucket")')
def rinse(sim: Simulation, thing: str) -> None:
    """Empty a thing and rinse it with cold water."""


@skill(verb="hand {thing} to {person}", past="handed", example='hand_over("cup", "adult")')
def hand_over(sim: Simulation, thing: str, person: str) -> None:
    """Hand a thing to a person in this room."""


@skill(verb="wait for {minutes} minutes", example="wait(5)")
def wait(sim: Simulation, minutes: float) -> None:
    """Wait."""
