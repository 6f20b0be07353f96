"""Writes a report: figures as PNG and PDF, tables as CSV, and the page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from collections.abc import Set as AbstractSet
from pathlib import Path

from codebotler.badinput import BadInput
from codebotler.files import write_whole
from roboeval.report.contents import Picture, Section
from roboeval.report.drawing import DARK, LIGHT, looking, written
from roboeval.report.page import GENERATOR, Drawn, page
from roboeval.report.sheets import Sheet, write_csv

FORMATS = ("png", "pdf")
PARTS = ("figures", "tables")
PAGE = "index.html"
UNFINISHED = ("This report is not finished; give the command again that writes it.",)
HEAD = 4_000  # characters at the beginning of a page, in which it says what it is
OPTIONAL = {
    *("abilities", "accepted", "beside", "beside-tasks", "budget", "coming-back", "cost", "differences"),
    *("failures", "published", "rejection-sampling", "rejection-sampling-curves", "reversals"),
}
"""Figures and tables that not every report has."""


def write_report(title: str, lead: Sequence[str], sections: Sequence[Section], out: Path) -> Iterator[str]:
    """Write a report into a folder, which is made if it is not there; the whole page comes last.

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
        for name in PARTS:
            (out / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"cannot be made ({error.strerror})", file=out) from None
    if not (out / PAGE).exists():
        write_whole(out / PAGE, page(title, UNFINISHED, [], {}).encode())
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
    write_whole(out / PAGE, page(title, lead, sections, drawn).encode())
    _forget_others(out, {*drawn, *(part.name for part in parts if isinstance(part, Sheet))})
    yield "page"


def expect_no_others(out: Path) -> None:
    """Refuse a folder that holds something else than a report.

    Args:
        out: the folder, which need not exist.

    Raises:
        BadInput: files would be lost there.
    """
    if not out.is_dir():
        return
    others = sorted(one.name for one in out.iterdir() if not one.name.startswith("."))
    if others and not _is_report(out / PAGE):
        raise BadInput(
            f'is no report, but holds other files, such as "{others[0]}"; name a new folder', file=out
        )


def _is_report(page_file: Path) -> bool:
    if not page_file.is_file():
        return False
    with page_file.open(errors="replace") as file:
        return GENERATOR in file.read(HEAD)


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
