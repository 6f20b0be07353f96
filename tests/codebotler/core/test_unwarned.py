"""Reading without warnings: what Python warns of elsewhere, in other threads and in forked processes."""

import os
import sys
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor

import pytest

from codebotler.core.syntaxtree import parse
from codebotler.core.unwarned import unwarned
from codebotler.rtl.pattern import compile_regex


def read(number: int) -> None:
    if number % 2:
        parse(rf"say('\d{number}')")
    else:
        compile_regex(f"[[a]{{{number}}}")


def test_threads_leave_the_filters_as_they_found_them() -> None:
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with warnings.catch_warnings(action="error"):
            before = list(warnings.filters)
            with ThreadPoolExecutor(4) as threads:
                list(threads.map(read, range(2000)))
            assert list(warnings.filters) == before
    finally:
        sys.setswitchinterval(interval)


def test_a_caller_who_catches_warnings_meanwhile_leaves_nobody_deaf() -> None:
    before = list(warnings.filters)
    caller, reading = warnings.catch_warnings(), unwarned()
    with reading:
        caller.__enter__()
    caller.__exit__(None, None, None)
    assert list(warnings.filters) == before
    caller, reading = warnings.catch_warnings(action="error"), unwarned()
    caller.__enter__()
    with reading:
        caller.__exit__(None, None, None)
    assert list(warnings.filters) == before


def test_filters_that_are_set_meanwhile_stay() -> None:
    with warnings.catch_warnings():
        with unwarned():
            warnings.simplefilter("ignore", SyntaxWarning)
            wanted = warnings.filters[0]
        assert warnings.filters[0] == wanted
        with unwarned():
            warnings.resetwarnings()
        assert not warnings.filters


def test_what_is_told_once_is_not_told_again() -> None:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("default")
        for _ in range(3):
            parse(r"say('\d')")
            warnings.warn("said before", UserWarning, stacklevel=1)
    assert [str(one.message) for one in told] == ["said before"]


def test_other_warnings_are_given() -> None:
    with unwarned(), pytest.warns(ResourceWarning, match="left open"):
        warnings.warn("left open", ResourceWarning, stacklevel=1)


@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_who_forks_in_the_middle_gets_no_locked_door() -> None:
    before = list(warnings.filters)
    inside, go_on = threading.Event(), threading.Event()

    def slowly() -> None:
        with unwarned():
            inside.set()
            go_on.wait(20)

    reader = threading.Thread(target=slowly)
    reader.start()
    assert inside.wait(20)
    threading.Timer(0.2, go_on.set).start()
    child = os.fork()
    if not child:
        unlocked: list[bool] = []
        trying = threading.Thread(target=lambda: unlocked.append(parse("1") is not None), daemon=True)
        trying.start()
        trying.join(5)
        os._exit(0 if unlocked else 1)
    assert os.waitpid(child, 0)[1] == 0
    reader.join()
    assert list(warnings.filters) == before
