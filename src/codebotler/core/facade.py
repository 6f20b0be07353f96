"""Lazy imports: the public names of a package, each imported when it is first used."""

from __future__ import annotations

TYPE_CHECKING = False  # what type checkers take for true; importing `typing` would cost what this saves
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping


def facade(package: str, homes: Mapping[str, str]) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """The `__getattr__` and `__dir__` of a package, from its name and the module of each public name."""

    def get(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name)
        from importlib import import_module  # noqa: PLC0415 - imported only when a name is used

        return getattr(import_module(f"{package}.{homes[name]}"), name)

    def names() -> list[str]:
        from sys import modules  # noqa: PLC0415 - as above

        return sorted({*vars(modules[package]), *homes})

    return get, names
