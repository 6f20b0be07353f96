"""Writes the list of all modules, each with the first line of its docstring, into docs/architecture.md."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "architecture.md"
HEAD = "## All modules\n"


def section() -> str:
    """Return the section, with a table for each room."""
    parts = [HEAD.strip(), "The first line of each module; `python website/modules.py` writes this list."]
    for package in ("codebotler", "roboeval"):
        source = ROOT / "src" / package
        rooms = sorted({path.parent for path in source.rglob("*.py")})
        parts += [table for room in rooms if (table := _table(room))]
    return "\n\n".join(parts) + "\n"


def _table(room: Path) -> str:
    rows = list(_rows(room))
    if not rows:
        return ""
    name = str(room.relative_to(ROOT / "src"))
    entry = next(path for path in (room / "__init__.py", room / "__main__.py") if path.exists())
    return "\n".join([f"| `{name}/` | {first_line(entry)} |", "|---|---|", *rows])


def _rows(room: Path) -> Iterator[str]:
    for path in sorted(room.glob("*.py")):
        if path.name not in {"__init__.py", "__main__.py"}:
            yield f"| `{path.name}` | {first_line(path)} |"


def first_line(path: Path) -> str:
    """Return the first line of a module's docstring."""
    found = re.match(r'"""(.*?)(?:"""|$)', path.read_text(), re.MULTILINE)
    return found[1].replace("|", "\\|") if found else ""


def page() -> str:
    """Return the page with an up-to-date section."""
    return PAGE.read_text().partition(HEAD)[0].rstrip() + "\n\n" + section()


if __name__ == "__main__":
    PAGE.write_text(page())
