"""The lists in docs match the modules, and the sources follow rules that no linter checks."""

import re
import runpy
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
GLOSSARY = ROOT / "docs" / "glossary.md"


def test_page_lists_all_modules_with_their_docstrings() -> None:
    modules = runpy.run_path(str(ROOT / "website" / "modules.py"))
    assert modules["PAGE"].read_text() == modules["page"](), (
        "run `python website/modules.py` to update the list"
    )


def test_picture_shows_the_layers_of_import_linter(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "website")
    rooms = runpy.run_path(str(ROOT / "website" / "rooms.py"))
    assert rooms["PICTURE"].read_text() == rooms["picture"](), "run `python website/rooms.py` to update it"


def test_glossary_names_existing_modules() -> None:
    rows = [line for line in GLOSSARY.read_text().splitlines() if line.startswith("| ")]
    named = [
        name for row in rows for name in re.findall(r"`([a-z_.]+)`", row.rstrip("| ").rpartition("|")[2])
    ]
    assert len(named) > 40
    assert [name for name in named if not _is_module(name)] == []


def _is_module(name: str) -> bool:
    places = [ROOT / "src" / package / name.replace(".", "/") for package in ("", "codebotler", "roboeval")]
    return any(place.is_dir() or place.with_suffix(".py").is_file() for place in places)


def test_imports_have_no_cycle() -> None:
    graph = {name: _imported_by(name, text) for name, text in _modules().items()}
    tuple(TopologicalSorter(graph).static_order())  # CycleError names the modules of a cycle.


def test_public_classes_and_constants_have_unique_names() -> None:
    owners: dict[str, set[str]] = {}
    for module, text in _modules().items():
        for name in _public_names(text):
            owners.setdefault(name, set()).add(module)
    assert {name: modules for name, modules in owners.items() if len(modules) > 1} == {}


def test_suppressed_checks_give_a_reason() -> None:
    bare = re.compile(r"# (noqa(: ?[A-Z0-9, ]+)?|type: ignore(\[[a-z, -]+\])?)$", re.MULTILINE)
    folders = ("src", "tests", "bench", "environments", "examples", "website")
    files = [file for folder in folders for file in (ROOT / folder).rglob("[!.]*.py")]
    assert len(files) > 700
    assert [file for file in files if bare.search(file.read_text())] == []


@cache
def _modules() -> dict[str, str]:
    """Return the text of each module of both packages, by the module's name."""
    root, found = ROOT / "src", {}
    for path in sorted(root.rglob("*.py")):
        name = ".".join(path.relative_to(root).with_suffix("").parts)
        found[name.removesuffix(".__init__")] = path.read_text()
    return found


def _imported_by(module: str, text: str) -> set[str]:
    """Return our modules that a module imports anywhere, even for types only."""
    modules, found = _modules().keys(), set[str]()
    for package, names in re.findall(r"^\s*from ([\w.]+) import (\([^)]*\)|.*)", text, re.MULTILINE):
        parts = {f"{package}.{name}" for name in re.findall(r"\w+", names)}
        found |= parts if parts <= modules else {package, *parts}
    return (found | {*re.findall(r"^\s*import ([\w.]+)", text, re.MULTILINE)}) & modules - {module}


def _public_names(text: str) -> set[str]:
    """Return the public classes and the constants that a module defines."""
    classes = re.findall(r"^class ([A-Z]\w*)", text, re.MULTILINE)
    assigned = re.findall(r"^([A-Z][A-Z0-9_]*(?:, [A-Z][A-Z0-9_]*)*)(?: =|: )", text, re.MULTILINE)
    return {*classes, *(name for each in assigned for name in each.split(", "))} - {"TYPE_CHECKING"}
