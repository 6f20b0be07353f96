"""The options of `@skill`, all of which may be left out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Literal, TypedDict, get_type_hints

from codebotler.core.skills.table import RosAction
from codebotler.core.skills.verbs import Verb


class SkillOptions(TypedDict, total=False):
    """The options of `@skill`, all optional, such as its verb, its errors, its event and its ROS action."""

    verb: Verb | str | None  # the English verb, such as `open {door}`, with parameters in braces [none]
    past: str  # the past form of an irregular verb that is not in the list, such as `wove`
    results: tuple[str, str]  # the meanings of False and True in words ["no", "yes"]
    fails: Mapping[str, str]  # the kinds of its errors, each with a clause that says when it occurs
    ros: RosAction | str | None  # the ROS action that executes it, such as `lab_msgs/OpenDoor:/open_door`
    example: str  # an example call for prompts [a call with the names of the parameters]
    event: str | None  # the kind of event that it records, or None for no event [the function's name]
    text: str  # the parameter that becomes the text of the event [the first one]
    names: Literal["room", "object", "object or person", "thing", ""]  # what the text names; empty for speech
    to: str | None  # the parameter that names the addressee of a question [none]
    when_tried: bool | None  # whether failed attempts are recorded, too [only for house rules, if at all]
    sets: str  # the state into which it brings the thing that the text names, such as `on`
    clears: str  # the state that it ends
    seconds: float  # its duration on the simulated clock in seconds, without driving [1]
    is_idle: bool  # whether it changes neither the robot nor its world [False]
    adds_event: bool  # whether the simulation records the event afterwards, not the function itself [True]


def wrong_options(options: Mapping[str, Any]) -> Iterator[str]:
    """Yield an error message for each option that does not exist or whose value has the wrong type."""
    from pydantic import ConfigDict, TypeAdapter, ValidationError  # noqa: PLC0415 - slow, and the paper's skills need none

    types = get_type_hints(SkillOptions)
    for name, value in options.items():
        if name not in types:
            yield f"@skill has no option {name}; its options are {', '.join(types)}"
            continue
        try:
            TypeAdapter(types[name], config=ConfigDict(strict=True)).validate_python(value)
        except ValidationError as error:
            yield f"the option {name} cannot be {value!r:.60}: {error.errors()[0]['msg']}"
