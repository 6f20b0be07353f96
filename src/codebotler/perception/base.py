"""The `Detector` protocol, and what every detector takes, returns and raises."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeAlias

from PIL.Image import Image

from codebotler.core.errors import UserError
from codebotler.core.terminal import visible

Box: TypeAlias = tuple[float, float, float, float]
"""Left, top, right and bottom as shares of a picture's width and height, from its upper left corner."""

LONGEST_LABEL = 200  # characters


@dataclass(frozen=True)
class Sighting:
    """The result of looking for something in a picture.

    Args:
        found: whether it is in the picture.
        box: the place of the clearest one; None if it was not found.
        score: how certain that is, from 0 to 1; what a score means differs from model to model.

    Raises:
        ValueError: the score or the box is out of its range.
    """

    found: bool
    box: Box | None
    score: float

    def __post_init__(self) -> None:
        if not 0 <= self.score <= 1:
            raise ValueError(f"the score is {self.score}, but it must be between 0 and 1")
        if self.box is None:
            return
        left, top, right, bottom = self.box
        if not (0 <= left < right <= 1 and 0 <= top < bottom <= 1):
            raise ValueError(
                f"the box is {list(self.box)}, but left must be less than right, top less than bottom, "
                "and each between 0 and 1"
            )


class Detector(Protocol):
    """Something that looks for things in pictures, one at a time."""

    @property
    def name(self) -> str:
        """The name of its model, such as `openai-chat:gpt-5.1` or `hf:PATH`."""

    def look(self, image: Image, label: str) -> Sighting:
        """Look for something in a picture.

        Args:
            image: the picture, as `codebotler.perception` reads it.
            label: what to look for, in a few plain words such as `red mug`.

        Raises:
            UserError: the label is no name.
            PerceptionError: there is no answer.
        """

    def close(self) -> None:
        """Release its connections and memory."""


class PerceptionError(Exception):
    """A detector has no answer; the sentence says why, and holds no keys."""

    def __init__(self, sentence: str) -> None:
        super().__init__(sentence)
        self.sentence = sentence


def checked_label(label: str) -> str:
    """The label on one line; a UserError if it is empty, too long, or cannot be printed."""
    words = " ".join(label.split())
    if not words:
        raise UserError("the label is empty; name an object to look for")
    if len(words) > LONGEST_LABEL:
        raise UserError(f"the label has {len(words):,} characters; use at most {LONGEST_LABEL}")
    if not words.isprintable():
        raise UserError(f'the label "{visible(words)}" has characters that cannot be printed; leave them out')
    return words
