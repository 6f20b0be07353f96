"""Properties that are computed once: also in a process that was forked in the middle."""

import os
import signal
import threading

import pytest

from codebotler.core.cachedproperty import cached_property


class Slow:
    """Computes as long as it is told to."""

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


def test_it_is_computed_once() -> None:
    slow = Slow(0)
    assert [slow.value, slow.value] == [1, 1]
    assert Slow.value.__doc__ == "How often it was computed."


@pytest.mark.filterwarnings("ignore:.*multi-threaded, use of fork:DeprecationWarning")
def test_a_forked_process_does_not_wait_for_a_thread_that_is_not_there() -> None:
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
