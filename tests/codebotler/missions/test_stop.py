"""The stop button cancels the robot first, and then calls its listeners."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from codebotler.missions.stop import StopButton
from doubles import FakeRobot


class RecordingRobot(FakeRobot):
    """A robot that records when it is cancelled."""

    def __init__(self, order: list[str]) -> None:
        super().__init__()
        self.order = order

    def cancel(self) -> None:
        super().cancel()
        self.order.append("robot")


def test_robot_is_cancelled_before_listeners_and_the_newest_comes_first() -> None:
    order: list[str] = []
    button = StopButton(RecordingRobot(order))
    button.on_press(lambda: order.append("log"))
    button.on_press(lambda: order.append("program"))
    button.press("a test")
    assert order == ["robot", "program", "log"]


def test_first_press_counts_and_each_reaches_the_robot() -> None:
    robot = FakeRobot()
    button = StopButton(robot)
    button.press("one")
    button.press("two")
    assert (button.by, robot.cancels) == ("one", 2)
    assert 0 <= button.seconds < 60


def test_failing_listener_does_not_prevent_the_others() -> None:
    called: list[str] = []

    def fail() -> None:
        raise OSError(28, "No space left on device")

    button = StopButton(FakeRobot())
    button.on_press(lambda: called.append("first"))
    button.on_press(fail)
    with pytest.raises(OSError, match="No space"):
        button.press("a test")
    assert called == ["first"]


def test_error_in_cancel_does_not_prevent_the_listeners() -> None:
    class Breaks(FakeRobot):
        def cancel(self) -> None:
            raise TypeError("no such motor")

    called: list[str] = []
    button = StopButton(Breaks())
    button.on_press(lambda: called.append("log"))
    with pytest.raises(TypeError):
        button.press("a test")
    assert called == ["log"]
    assert button.ended.is_set()


def test_nothing_starts_while_the_robot_is_still_being_cancelled() -> None:
    may_go_on, is_asked = threading.Event(), threading.Event()

    class Slow(FakeRobot):
        def cancel(self) -> None:
            is_asked.set()
            assert may_go_on.wait(30)

    button = StopButton(Slow())
    with ThreadPoolExecutor(1) as threads:
        pressing = threads.submit(button.press, "a test")
        assert is_asked.wait(30)
        assert button.ended.is_set()
        assert button.by == "a test"
        may_go_on.set()
        pressing.result(30)


def test_robot_that_is_connected_after_the_press_is_cancelled_at_once() -> None:
    robot, button = FakeRobot(), StopButton()
    button.press("a test")
    button.attach(robot)
    assert robot.cancels == 1


def test_listener_that_comes_after_the_press_is_called_at_once() -> None:
    called: list[str] = []
    button = StopButton(FakeRobot())
    button.press("a test")
    button.on_press(lambda: called.append("late"))
    assert called == ["late"]


def test_robot_alone_can_be_cancelled_without_a_press() -> None:
    called: list[str] = []
    robot = FakeRobot()
    button = StopButton(robot)
    button.on_press(lambda: called.append("log"))
    button.cancel_robot()
    assert (button.by, robot.cancels, called, button.ended.is_set()) == (None, 1, [], True)
