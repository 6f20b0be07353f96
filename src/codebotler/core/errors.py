"""What users can mend: a mistake of theirs, with its file and line, and a package that is not installed."""

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
"""The extra of this distribution that brings each package."""

LONGEST_SENTENCE = 600  # characters of a sentence; of a longer one, the ends are shown


class UserError(ValueError):
    """Something that a user gave cannot be used; one sentence says what, where, and how to mend it.

    Args:
        sentence: what is wrong and, where it helps, the mend; put on one line, and a very long one shortened.
        file: the file it is in.
        line: the line, counted from 1.
    """

    def __init__(self, sentence: str, *, file: Path | str | None = None, line: int | None = None) -> None:
        self.sentence = both_ends(" ".join(sentence.splitlines()), LONGEST_SENTENCE)
        self.file, self.line = file, line
        where = "" if file is None else f"{file}: " if line is None else f"{file}, line {line}: "
        super().__init__(where + self.sentence)

    def __reduce__(self) -> tuple[object, ...]:
        return partial(type(self), file=self.file, line=self.line), (self.sentence,), vars(self)


def both_ends(text: str, longest: int) -> str:
    """A text, or the two ends of a longer one."""
    half = longest // 2
    return text if len(text) <= longest else f"{text[:half]} ... {text[-half:]}"


BadInput = UserError  # the former name, for one version


def expect_list(given: Sequence[str] | None, what: str) -> None:
    """Refuse a single text in place of a list, since Python would take its letters."""
    if isinstance(given, str):
        raise UserError(f"{what} must be a list, not the single string {given[:40]!r}")


def install_command(package: str) -> str:
    """What to type to install the extra that brings a package."""
    return f"pip install 'codebotler[{EXTRAS[package]}]'"


def missing_package(error: ModuleNotFoundError) -> str:
    """The package of an extra that an import did not find; empty if it was another."""
    package = (error.name or "").split(".")[0]
    return package if package in EXTRAS else ""


@contextmanager
def installed() -> Iterator[None]:
    """Import packages of an extra; UserError with the command that installs one that is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        package = missing_package(error)
        if not package:
            raise
        raise UserError(f"{package} is not installed; `{install_command(package)}` installs it") from None


VIOLATION = "RuleViolation"
"""The kind of error by which a house rule ends a run, or refuses a skill."""


class RobotError(Exception):
    """The robot cannot do what it was asked to do.

    Args:
        kind: one of the seven kinds of the taxonomy (paper, section V.B, and AskInvalidOptions), or
            RuleViolation.
        message: why, in a sentence.
    """

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(message)
        self.kind = kind

    @property
    def ends_run(self) -> bool:
        """Whether the program cannot go on, whatever it catches."""
        return False

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.kind, str(self)), vars(self)
