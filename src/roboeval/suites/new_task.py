"""The start of a new task: a small whole one, with comments, in a suite of its own if there is none."""

from __future__ import annotations

import re
from pathlib import Path

from codebotler.badinput import BadInput
from codebotler.files import write_whole
from roboeval.suites.load import ABLATED, shipped_suites

_TEMPLATE = Path(__file__).parent / "template"


def new_task(folder: Path, name: str) -> Path:
    """Start a task in a suite's folder, and the suite if there is none; the files say what to fill in.

    Solutions come with it, unless there are some for a task of this name already.

    Args:
        folder: of the suite.
        name: of the task.

    Raises:
        BadInput: the name cannot be one, the task is there already, or the folder cannot be written or lies
            within another suite.
    """
    if not re.fullmatch(r"[A-Z][A-Za-z0-9]*", name):
        raise BadInput(
            f'"{name}" is no name for a task; write words together, each with a capital, such as WaterPlants'
        )
    if (folder.resolve().parent / "suite.yaml").exists():
        raise BadInput("lies within a suite; name the folder around it", file=folder)
    path = folder / "tasks" / f"{name}.yaml"
    if path.exists():
        raise BadInput("is there already; choose another name, or edit it", file=path)
    files = {"new-suite.yaml": folder / "suite.yaml", "new-solutions.yaml": folder / "solutions" / path.name}
    try:
        for template, file in files.items():
            if not file.exists():
                _write(template, file, _suite_name(folder))
        _write("new-task.yaml", path, name)
    except OSError as error:
        raise BadInput(f"cannot be written ({error.strerror})", file=error.filename) from None
    return path


def _write(template: str, file: Path, name: str) -> None:
    write_whole(file, (_TEMPLATE / template).read_text().replace("NAME", name).encode())


def _suite_name(folder: Path) -> str:
    """A name for the suite in a folder: the folder's, as far as it can be one."""
    plain = re.sub(r"[^a-z0-9-]", "-", folder.resolve().name.lower())
    name = plain.lstrip("-0123456789").removesuffix(ABLATED)
    return f"my-{name}" if name in shipped_suites() else name or "mine"
