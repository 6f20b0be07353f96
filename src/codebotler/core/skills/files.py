"""Load files of custom skills, which are the user's own code and run in this process."""

from __future__ import annotations

import hashlib
from pathlib import Path
from traceback import extract_tb
from types import ModuleType

from codebotler.core.errors import UserError
from codebotler.core.skills.own_modules import is_own_module, load_own_module, location_of
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill, SkillTable


def skills_from(*files: Path | str) -> SkillTable:
    """Return the eight skills of the paper and the skills that files declare with `@skill`.

    Args:
        files: Python files, which are executed.

    Raises:
        UserError: a file fails, declares no skill, or declares one whose name is taken.
    """
    rows = [*SKILLS.rows]
    for path in {Path(file).resolve(): Path(file) for file in files}.values():
        found = _declared_skills(path)
        if not found:
            raise UserError("the file declares no skill; put @skill above a function", file=path)
        for row in found:
            _expect_new(row, rows)
            rows.append(row)
    return SkillTable(tuple(rows)) if files else SKILLS


def _declared_skills(path: Path) -> list[Skill]:
    module = load_skill_module(path)
    found = [value for value in vars(module).values() if isinstance(value, Skill)]
    return [row for row in dict.fromkeys(found) if getattr(row.does, "__module__", "") == module.__name__]


def files_of(skills: SkillTable) -> dict[str, str]:
    """Return the SHA-256 hash (in hexadecimal) of each file with skills of the table, by the file's name."""
    modules = {getattr(row.does, "__module__", "") for row in skills.rows}
    paths = {Path(location_of(name)) for name in modules if is_own_module(name)}
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(paths)}


def load_skill_module(path: Path) -> ModuleType:
    """Run a file of custom skills once, and return its module. Raise UserError if the file fails."""
    try:
        return load_own_module(path)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - the file may raise anything
        raise _as_user_error(path, error) from None


def _as_user_error(path: Path, error: BaseException) -> UserError:
    """Convert an error of a file to a UserError with the line at which the file failed."""
    if isinstance(error, UserError) and error.file is not None:
        return error
    if isinstance(error, SyntaxError):
        return UserError(f"the file is not Python: {error.msg}", file=path, line=error.lineno)
    lines = [frame.lineno for frame in extract_tb(error.__traceback__) if frame.filename == str(path)]
    is_ours = isinstance(error, UserError)
    sentence = str(error) if is_ours else f"the file cannot be run: {type(error).__name__}: {error}"
    return UserError(sentence, file=path, line=lines[-1] if lines else None)


def _expect_new(row: Skill, rows: list[Skill]) -> None:
    clash = _names_of(row) & {name for other in rows for name in _names_of(other)}
    if clash:
        row.wrong(f'"{min(clash)}" is the name, event or ROS action of another skill; choose another one')
    every = [*rows, row]
    recordings = [one.recording for one in every if one.recording is not None]
    states = {state for one in recordings for state in (one.sets, one.clears)}
    both = states & {name for one in every for name in _names_of(one)}
    if both:
        row.wrong(f"{min(both)} is the name of a skill and of a state; choose another name")


def _names_of(row: Skill) -> set[str]:
    """Return the name of a skill, of its events and of its ROS action."""
    event, topic = row.recording and row.recording.kind, row.ros and row.ros.server
    return {name for name in (row.name, event, topic) if name}
