"""docs/architecture.md lists each module with its first line; docs/glossary.md names modules that exist."""

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
GLOSSARY = ROOT / "docs" / "glossary.md"


def test_all_modules_are_listed_as_they_describe_themselves() -> None:
    modules = runpy.run_path(str(ROOT / "website" / "modules.py"))
    assert modules["PAGE"].read_text() == modules["page"](), (
        "`python website/modules.py` writes the list anew"
    )


def test_the_picture_shows_the_rooms_that_the_linter_keeps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "website")
    rooms = runpy.run_path(str(ROOT / "website" / "rooms.py"))
    assert rooms["PICTURE"].read_text() == rooms["picture"](), "`python website/rooms.py` draws it anew"


def test_the_glossary_names_modules_that_are_there() -> None:
    rows = [line for line in GLOSSARY.read_text().splitlines() if line.startswith("| ")]
    named = [
        name for row in rows for name in re.findall(r"`([a-z_.]+)`", row.rstrip("| ").rpartition("|")[2])
    ]
    assert len(named) > 40
    assert [name for name in named if not _is_module(name)] == []


def _is_module(name: str) -> bool:
    places = [ROOT / "src" / package / name.replace(".", "/") for package in ("", "codebotler", "roboeval")]
    return any(place.is_dir() or place.with_suffix(".py").is_file() for place in places)
