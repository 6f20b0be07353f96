"""Writes a report: figures as PNG and PDF, tables as CSV, and the page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from collections.abc import Set as AbstractSet
from pathlib import Path

from codebotler.badinput import BadInput
from roboeval.report.contents import Picture, Section
from roboeval.report.drawing import DARK, LIGHT, looking, written
from roboeval.report.page import Drawn, page
from roboeval.report.sheets import Sheet, write_csv
from roboeval.run import write_whole

FORMATS = ("png", "pdf")
OPTIONAL = {
    *("abilities", "accepted", "beside", "beside-tasks", "budget", "coming-back", "cost", "differences"),
    *("failures", "published", "rejection-sampling", "rejection-sampling-curves", "reversals"),
}
"""Figures and tables that not every report has."""


def write_report(title: str, lead: Sequence[str], sections: Sequence[Section], out: Path) -> Iterator[str]:
    """Write a report into a folder, which is made if it is not there; the page comes last.

    Args:
        title: of the page.
        lead: paragraphs at its beginning.
        sections: what it holds.
        out: the folder.

    Yields:
        what is written, piece by piece.

    Raises:
        BadInput: the folder cannot be made.
        OSError: a file cannot be written; what stood there stays.
    """
    parts = [part for section in sections for part in section.parts]
    try:
        for folder in (out / "figures", out / "tables"):
            folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"cannot be made ({error.strerror})", file=out) from None
    drawn: dict[str, Drawn] = {}
    for part in parts:
        match part:
            case Sheet():
                write_csv(part, out / "tables")
                yield part.name
            case Picture():
                found = _draw(part, out / "figures")
                drawn |= {} if found is None else {part.name: found}
                yield part.name
            case _:
                pass
    write_whole(out / "index.html", page(title, lead, sections, drawn).encode())
    _forget_others(out, {*drawn, *(part.name for part in parts if isinstance(part, Sheet))})
    yield "page"


def _forget_others(out: Path, names: AbstractSet[str]) -> None:
    """Remove what an earlier report wrote here that this one has not, such as rejection sampling."""
    for name in OPTIONAL - names:
        for file in (f"tables/{name}.csv", *(f"figures/{name}.{kind}" for kind in FORMATS)):
            (out / file).unlink(missing_ok=True)


def pieces(sections: Sequence[Section]) -> int:
    """How many pieces `write_report` tells of."""
    return 1 + sum(isinstance(part, Sheet | Picture) for section in sections for part in section.parts)


def _draw(picture: Picture, folder: Path) -> Drawn | None:
    """Draw a figure, write it, and give it for the page; None if there is nothing to draw."""
    with looking(LIGHT):
        figure = picture.draw(LIGHT)
        if figure is None:
            return None
        for kind in FORMATS:
            write_whole(folder / f"{picture.name}.{kind}", written(figure, kind))
        light = written(figure, "svg")
    with looking(DARK):
        dark = picture.draw(DARK)
        assert dark is not None
        return light, written(dark, "svg")
