"""Properties that are computed once, without a lock that a forked process would find closed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, Self, TypeVar, overload

Value = TypeVar("Value")


class cached_property(Generic[Value]):  # noqa: N801 - named as in functools
    """Like that of functools, which before Python 3.12 has one lock for all objects of a class.

    While one thread holds it, a forked process gets a lock that nobody opens. Two threads may compute the
    same value twice.

    Args:
        compute: what tells the value of an object; the same one each time.
    """

    def __init__(self, compute: Callable[..., Value]) -> None:
        self._compute = compute
        self.__doc__ = compute.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        """Learn its name, under which objects keep the value and look it up first."""
        self._name = name

    @overload
    def __get__(self, instance: None, owner: type | None = None) -> Self: ...

    @overload
    def __get__(self, instance: object, owner: type | None = None) -> Value: ...

    def __get__(self, instance: object, owner: type | None = None) -> Value | Self:
        """The value of an object, to be kept."""
        if instance is None:
            return self
        value = vars(instance)[self._name] = self._compute(instance)
        return value
