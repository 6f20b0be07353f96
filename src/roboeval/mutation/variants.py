"""Right programs in many styles, written by hand from the instructions, never from the requirements."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from codebotler.badinput import BadInput
from roboeval.suites.load import Task

FOLDER = Path(__file__).with_name("right")


@dataclass(frozen=True)
class Variant:
    """A right program.

    Args:
        name: of its file, such as `03-backwards`.
        style: what is special about it, in a sentence; the comment that its file begins with.
        program: its source.
    """

    name: str
    style: str
    program: str


def variants(task: Task) -> tuple[Variant, ...]:
    """The right programs of a task, in the order of their names.

    They stand in `right/TASK/*.py` of the suite's folder; where it has no such folder, in the package.

    Args:
        task: the task.

    Raises:
        BadInput: a file cannot be read, or does not begin with its style.
    """
    own = task.path.parents[1] / "right"
    folder = own if own.is_dir() else FOLDER
    return tuple(_read(path) for path in sorted((folder / task.name).glob("*.py")))


def _read(path: Path) -> Variant:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"this right program cannot be read: {error}", file=path) from None
    first = text.partition("\n")[0]
    if not first.startswith("# "):
        raise BadInput("say the program's style in its first line, as a comment", file=path, line=1)
    return Variant(path.stem, first.removeprefix("# "), text)
