"""Reading programs, regexes and pictures of others without warning of what is odd in them."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

# Of odd escapes, of what is deprecated, and of sets in regexes that may mean something else one day.
ODD = (SyntaxWarning, DeprecationWarning, FutureWarning)

# `catch_warnings` puts back what it found: where two threads overlap, one finds what the other has set, and
# the process stays deaf to warnings for good.
_ONE = threading.RLock()
# Who forks in the middle of it would get a lock that nobody opens, and no warnings.
os.register_at_fork(before=_ONE.acquire, after_in_parent=_ONE.release, after_in_child=_ONE.release)


@contextmanager
def unwarned(kinds: Sequence[type[Warning]] = ODD) -> Iterator[None]:
    """While something is read: nobody is warned of what is odd in it, and no other thread is in here.

    Args:
        kinds: which warnings are not given; all others are.
    """
    with _ONE, warnings.catch_warnings():
        for kind in kinds:
            warnings.simplefilter("ignore", kind)
        yield
