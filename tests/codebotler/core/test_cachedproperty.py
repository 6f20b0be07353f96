"""`cached_property` computes once, and a fork during a computation does not block the child."""

import os
import signal
import threading

import pytest

from codebotler.core.cachedproperty import cached_property


class Slow:
    """Holds its computation until `go_on` is set or `patience` seconds have passed."""

    def __init__(self, patience: float) -> None:
        self.patience, self.computed = patience, 0
        self.begun, self.go_on = threading.Event(), threading.Event()

    @cached_property
    def value(self) -> int:
        """How often it was computed."""
        self.begun.set()
        self.go_on.wait(self.patience)
        self.computed += 1
        return self.computed


def test_property_is_computed_once() -> None:
    slow = Slow(0)
    assert [slow.value, slow.value] == [1, 1]
    assert Slow.value.__doc__ == "How often it was computed."


@pytest.mark.filterwarnings("ignore:.*multi-threaded, use of fork:DeprecationWarning")
def test_forked_process_does_not_wait_for_a_thread_of_its_parent() -> None:
    slow, quick = Slow(20), Slow(0)
    other = threading.Thread(target=lambda: slow.value)
    other.start()
    assert slow.begun.wait(20)
    child = os.fork()
    if not child:
        signal.alarm(5)
        os._exit(0 if quick.value == 1 else 1)
    status = os.waitpid(child, 0)[1]
    slow.go_on.set()
    other.join()
    assert status == 0
