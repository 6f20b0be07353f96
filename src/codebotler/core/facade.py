"""What a package offers to who imports it, each name imported when it is first used."""

from __future__ import annotations

TYPE_CHECKING = False  # what type checkers take for true; importing `typing` would cost what this saves
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping


def facade(package: str, homes: Mapping[str, str]) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """The `__getattr__` and the `__dir__` of a package: who needs one name need not wait for all.

    Args:
        package: its name.
        homes: for each name that it offers, the module in it that has it.
    """

    def get(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name)
        from importlib import import_module  # noqa: PLC0415 - only where something is used

        return getattr(import_module(f"{package}.{homes[name]}"), name)

    def names() -> list[str]:
        from sys import modules  # noqa: PLC0415 - only where somebody asks

        return sorted({*vars(modules[package]), *homes})

    return get, names
