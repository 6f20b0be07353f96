"""What `codebotler run` asks a robot before it moves, and what it makes of the answers."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from codebotler.robots.base import CancelledError, NotReadyError, Result
from codebotler.running import preflight
from doubles import Answering, raising


def knowing(rooms: object, here: object = "") -> Callable[[str, str], Result]:
    """Answers of a robot that says which rooms it knows and where it is."""
    answers = {"get_all_rooms": rooms, "get_current_location": here}
    return lambda skill, _first: answers.get(skill)  # type: ignore[return-value]  # robots say anything


@pytest.mark.parametrize(
    ("rooms", "here", "sentence"),
    [
        ([1, None, {}], "hall", r"answers get_all_rooms with \[1, None, {}\], no list\[str\]"),
        ("hall", "hall", r"answers get_all_rooms with 'hall', no list\[str\]"),
        (["hall"], ["hall"], r"answers get_current_location with \['hall'\], no str"),
        (["hall"], None, r"answers get_current_location with None, no str"),
    ],
)
def test_answer_that_is_none_is_said_before_the_robot_moves(
    rooms: object, here: object, sentence: str
) -> None:
    with pytest.raises(NotReadyError, match=f"does not say which rooms it knows: the robot {sentence}"):
        preflight(Answering(knowing(rooms, here)))


def test_robot_that_somebody_stops_before_it_moves_is_not_ready() -> None:
    with pytest.raises(NotReadyError, match="does not say which rooms it knows: somebody stopped it"):
        preflight(Answering(raising(CancelledError())))
