"""Pages that other packages add to ours, by an entry point in the group `codebotler.pages`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import TypeAlias

from fastapi import FastAPI

from codebotler.core.terminal import note
from codebotler.web.frame import Frame

GROUP = "codebotler.pages"


@dataclass(frozen=True)
class Site:
    """To what pages are added. The guard stands before all that is added, too, and lets no face see it.

    Args:
        app: takes further addresses: of the API below `/api/`, of files below `/static/`.
        frame: gives what all pages have; it is called first of all on each page.
        runs: the folder of runs that somebody named, or the usual one.
    """

    app: FastAPI
    frame: Frame
    runs: Path


@dataclass(frozen=True)
class Pages:
    """Further pages.

    Args:
        name: in the bar.
        brand: what it is all called where there are no other pages.
        address: of the first of them.
        add: puts them, and what belongs to them, at their addresses.
    """

    name: str
    brand: str
    address: str
    add: Callable[[Site], None]


Further: TypeAlias = tuple[Pages, ...]


def installed() -> Further:
    """What the packages of this environment add; what cannot be loaded is said, and left out."""
    return tuple(_loaded())


def _loaded() -> Iterator[Pages]:
    for point in sorted(entry_points(group=GROUP), key=lambda point: point.name):
        try:
            pages = point.load()
            if not isinstance(pages, Pages):
                raise TypeError(f"{point.value} are no Pages")  # noqa: TRY301 - told like all else
        except Exception as error:  # noqa: BLE001 - nobody's package keeps anybody from their robot
            note(f'the pages "{point.name}" cannot be added: {error}')
        else:
            yield pages
