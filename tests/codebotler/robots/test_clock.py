"""A robot's time passes at its speed, and a stop ends all waiting."""

import threading
import time

import pytest

from codebotler.core.errors import UserError
from codebotler.robots.clock import Clock


def test_time_passes_at_its_speed() -> None:
    clock = Clock(speed=100)
    start, began = clock.now, time.monotonic()
    assert clock.wait(20)
    took = time.monotonic() - began
    assert 0.2 <= took < 2
    assert clock.now - start == pytest.approx(100 * took, abs=5)


def test_without_a_speed_time_passes_only_by_waiting() -> None:
    clock = Clock(speed=None)
    assert (clock.now, clock.wait(3600), clock.now) == (0, True, 3600)


@pytest.mark.parametrize("speed", [1.0, None])
def test_stop_ends_all_waiting_until_the_restart(speed: float | None) -> None:
    clock = Clock(speed)
    threading.Timer(0.05, clock.stop).start()
    if speed:
        began = time.monotonic()
        assert not clock.wait(3600)
        assert time.monotonic() - began < 5
    clock.stop()
    assert not clock.wait(3600)
    assert clock.now < 3600
    clock.restart()
    assert clock.wait(0.001)


@pytest.mark.parametrize("speed", [0, -1, 1e-308, 1e308, float("inf"), float("nan")])
def test_speed_out_of_its_range_is_refused(speed: float) -> None:
    with pytest.raises(UserError, match=r"0\.000001 to 1,000,000"):
        Clock(speed)
