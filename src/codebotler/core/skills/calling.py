"""Call the function of a custom skill, and report undeclared results and errors."""

from __future__ import annotations

from collections.abc import Sequence
from traceback import walk_tb
from typing import Any

from codebotler.core.errors import RobotError, UserError
from codebotler.core.skills.table import Skill
from codebotler.core.skills.values import plain

SKILL_FAILED = "SkillFailed"
"""The kind of the error reported when a custom skill's function raises an undeclared exception."""


def call_skill(row: Skill, robot: object, arguments: Sequence[Any]) -> Any:  # noqa: ANN401 - the declared type
    """Return a custom skill's result. Raise RobotError if it fails, or UserError if its result is wrong."""
    assert row.does is not None, "a custom skill has a function"
    given = [
        [option.text for option in argument] if parameter.is_options else parameter.type.convert(argument)
        for parameter, argument in zip(row.parameters, arguments, strict=True)
    ]
    code = getattr(row.does, "__wrapped__", row.does).__code__
    try:
        result = plain(row.does(robot, *given))
    except (RobotError, UserError, KeyboardInterrupt):
        raise
    except BaseException as error:
        frames = walk_tb(error.__traceback__)
        lines = [line for frame, line in frames if frame.f_code.co_filename == code.co_filename]
        file = code.co_filename.rpartition("/")[2]  # results must not depend on the folder
        where = f"{file}, line {lines[-1] if lines else code.co_firstlineno}"
        said = str(error).replace(type(robot).__name__, "Simulation")
        message = f"{row.name} failed in {where}: {type(error).__name__}: {said}"
        raise RobotError(SKILL_FAILED, message) from error
    asks = [one for one, parameter in zip(given, row.parameters, strict=True) if parameter.is_options]
    if (asks and result not in asks[0]) or not row.returns.fits(result):
        must = "one of the given options" if asks else row.returns.in_words
        row.wrong(f"{row.name} returned {result!r:.80}, but its function must return {must}")
    return result
