"""Creates the files of a new task, and of a new suite if needed."""

from __future__ import annotations

import re
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.core.files import write_whole
from roboeval.suites.load import ABLATED, shipped_suites

_TEMPLATE = Path(__file__).parent / "template"


def new_task(folder: Path, name: str) -> Path:
    """Create the files of a new task, and of the suite if needed. Return the path of the task file."""
    if not re.fullmatch(r"[A-Z][A-Za-z0-9]*", name):
        raise UserError(f'"{name}" is not a task name; join capitalised words, as in WaterPlants')
    if (folder.resolve().parent / "suite.yaml").exists():
        raise UserError("the folder is a subfolder of a suite; choose the suite's own folder", file=folder)
    path = folder / "tasks" / f"{name}.yaml"
    if path.exists():
        raise UserError("the task already exists; edit its file or choose another name", file=path)
    files = {
        folder / "suite.yaml": ("new-suite.yaml", _suite_name(folder)),
        folder / "solutions" / path.name: ("new-solutions.yaml", ""),
        path: ("new-task.yaml", name),
    }
    for file, (template, put) in files.items():
        if not file.exists():
            write_whole(file, (_TEMPLATE / template).read_text().replace("NAME", put).encode())
    return path


def _suite_name(folder: Path) -> str:
    plain = re.sub(r"[^a-z0-9-]", "-", folder.resolve().name.lower())
    name = plain.lstrip("-0123456789").removesuffix(ABLATED)
    return f"my-{name}" if name in shipped_suites() else name or "mine"
