"""Errors that users can fix: mistakes, with file and line, and missing packages; errors of a robot."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial

TYPE_CHECKING = False
if TYPE_CHECKING:
    from pathlib import Path

EXTRAS = {
    **dict.fromkeys(("anthropic", "google", "httpx", "openai", "pydantic_ai"), "models"),
    **dict.fromkeys(("fastapi", "nicegui", "starlette", "uvicorn"), "page"),
    **dict.fromkeys(("PIL", "mcap", "websockets"), "robots"),
    **dict.fromkeys(("jinja2", "torch", "transformers"), "transformers"),
    "matplotlib": "report",
    "pyrobosim": "pyrobosim",
    "ray": "ray",
}
"""The extra of this distribution that installs each package."""

MAX_SENTENCE_LENGTH = 600


class UserError(ValueError):
    """A mistake in a user's input; one sentence says what is wrong, where, and how to fix it.

    Args:
        sentence: the problem and the fix; joined to one line, and shortened if very long.
        file: the file with the mistake.
        line: the line, counted from 1.
    """

    def __init__(self, sentence: str, *, file: Path | str | None = None, line: int | None = None) -> None:
        self.sentence = elide_middle(" ".join(sentence.splitlines()), MAX_SENTENCE_LENGTH)
        self.file, self.line = file, line
        where = "" if file is None else f"{file}: " if line is None else f"{file}, line {line}: "
        super().__init__(where + self.sentence)

    def __reduce__(self) -> tuple[object, ...]:
        return partial(type(self), file=self.file, line=self.line), (self.sentence,), vars(self)


def elide_middle(text: str, longest: int) -> str:
    """Return a text, or both ends of a longer one."""
    half = longest // 2
    return text if len(text) <= longest else f"{text[:half]} ... {text[-half:]}"


BadInput = UserError  # the former name, for one version


def expect_list(given: Sequence[str] | None, what: str) -> None:
    """Reject a string in place of a list, since Python would iterate over its characters."""
    if isinstance(given, str):
        raise UserError(f"{what} must be a list, not the single string {given[:40]!r}")


def install_command(package: str) -> str:
    """Return the command that installs the extra with a package."""
    return f"pip install 'codebotler[{EXTRAS[package]}]'"


def missing_package(error: ModuleNotFoundError) -> str:
    """Return the package of an extra that an import did not find; empty for any other package."""
    package = (error.name or "").split(".")[0]
    return package if package in EXTRAS else ""


@contextmanager
def installed() -> Iterator[None]:
    """Import packages of an extra; a missing one raises UserError with the command to install it."""
    try:
        yield
    except ModuleNotFoundError as error:
        package = missing_package(error)
        if not package:
            raise
        raise UserError(f"{package} is not installed; `{install_command(package)}` installs it") from None


VIOLATION = "RuleViolation"
"""The kind of error with which a house rule ends a run or refuses a skill."""


class RobotError(Exception):
    """A skill that the robot cannot execute.

    Args:
        kind: one of the seven kinds of the taxonomy (paper, section V.B, and AskInvalidOptions), or
            RuleViolation.
        message: the reason, in a sentence.
    """

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(message)
        self.kind = kind

    @property
    def ends_run(self) -> bool:
        """Whether the run ends even if the program catches the error."""
        return False

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.kind, str(self)), vars(self)
