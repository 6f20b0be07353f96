"""Errors that users can fix, such as mistakes in files and missing packages, and the errors of robots."""

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
    "mcp": "mcp",
    "pyrobosim": "pyrobosim",
    "ray": "ray",
}
"""Maps each optional package to our extra that installs it: `PIL` needs `codebotler[robots]`."""

MAX_SENTENCE_LENGTH = 600


class UserError(ValueError):
    """Raised for a mistake in a user's input, with a sentence that says what is wrong and how to fix it.

    Args:
        sentence: the problem and its fix, which are put on one line and shortened if very long.
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
    """Return a text in which ` ... ` replaces the middle if it is longer than `longest` characters."""
    half = longest // 2
    return text if len(text) <= longest else f"{text[:half]} ... {text[-half:]}"


BadInput = UserError  # the former name, for one version


def expect_list(given: Sequence[str] | None, what: str) -> None:
    """Raise UserError if an argument, named `what`, is a string instead of a list: `rooms="lobby"`."""
    if isinstance(given, str):
        raise UserError(f"{what} must be a list, not the single string {given[:40]!r}")


def install_command(package: str) -> str:
    """Return the pip command for an optional package: `pip install 'codebotler[robots]'` for `PIL`."""
    return f"pip install 'codebotler[{EXTRAS[package]}]'"


@contextmanager
def installed() -> Iterator[None]:
    """In a `with` block, turn a missing optional package into a UserError with the command to install it."""
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").split(".")[0]
        if package not in EXTRAS:
            raise
        raise UserError(f"{package} is not installed; `{install_command(package)}` installs it") from None


VIOLATION = "RuleViolation"
"""The `kind` of the RobotError that is raised when a house rule refuses a skill or ends a run."""


class RobotError(Exception):
    """Raised when the robot cannot execute a skill.

    Args:
        kind: such as `GoToInvalidLocation` (section V.B of the paper), `RuleViolation`, or a kind that a
            custom skill declares.
        message: the reason, in a sentence.
    """

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(message)
        self.kind = kind

    @property
    def ends_run(self) -> bool:
        """Whether the run ends even if the program catches the error, as for most broken house rules."""
        return False

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.kind, str(self)), vars(self)
