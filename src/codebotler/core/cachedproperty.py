"""`functools.cached_property` without the lock that it has in Python 3.11."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING or sys.version_info >= (3, 12):
    from functools import cached_property  # noqa: TID251 - no lock in Python 3.12
else:

    class cached_property:  # noqa: N801 - named as in functools
        """A property that is computed on first access and then kept. Two threads may compute it at once.

        It has no lock, since the lock of functools is shared by all objects of a class. A process that forks
        while another thread holds that lock would deadlock.
        """

        def __init__(self, compute: Callable[[Any], object]) -> None:
            self._compute = compute
            self.__doc__ = compute.__doc__

        def __set_name__(self, owner: type, name: str) -> None:
            self._name = name

        def __get__(self, instance: object, owner: type | None = None) -> object:
            if instance is None:
                return self
            value = vars(instance)[self._name] = self._compute(instance)
            return value


__all__ = ["cached_property"]
