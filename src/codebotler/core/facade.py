"""Lazy imports: the public names of a package, each imported on first use."""

from __future__ import annotations

TYPE_CHECKING = False  # true for type checkers; importing `typing` would cost what this saves
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence


def facade(
    package: str, public: Mapping[str, Sequence[str]]
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` for a package; `public` maps each module to the names it defines."""
    homes = {name: module for module, names in public.items() for name in names}

    def get(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name)
        from importlib import import_module  # noqa: PLC0415 - imported only when a name is used

        return getattr(import_module(f"{package}.{homes[name]}"), name)

    def names() -> list[str]:
        from sys import modules  # noqa: PLC0415 - only used by dir()

        return sorted({*vars(modules[package]), *homes})

    return get, names
