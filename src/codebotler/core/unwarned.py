"""Reading programs, regexes and pictures of others without warning of what is odd in them."""

from __future__ import annotations

import os
import re
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, cast

# Of odd escapes, of what is deprecated, and of sets in regexes that may mean something else one day.
ODD = (SyntaxWarning, DeprecationWarning, FutureWarning)

# Matches every message, and is in no filter but ours, so that we take out none of others.
_ANY = re.compile("(?#of what others wrote)")

# One thread at a time: who forks in the middle would take our filters along, and so waits.
_ONE = threading.RLock()
os.register_at_fork(before=_ONE.acquire, after_in_parent=_ONE.release, after_in_child=_ONE.release)


@contextmanager
def unwarned(kinds: Sequence[type[Warning]] = ODD) -> Iterator[None]:
    """While something is read: nobody is warned of what is odd in it, and no other thread is in here.

    Args:
        kinds: which warnings are not given; all others are.
    """
    # No `catch_warnings`: it puts back what it found, and so does that of another thread. Where the two
    # overlap, one puts back what the other has set, for good. Nor `simplefilter`: Python forgets by it which
    # warnings it has given already.
    ours = [("ignore", _ANY, kind, None, 0) for kind in kinds]
    with _ONE:
        filters = cast("list[Any]", warnings.filters)
        filters[:0] = ours
        try:
            yield
        finally:
            for each in ours:
                with suppress(ValueError):  # `resetwarnings` took it out
                    filters.remove(each)
