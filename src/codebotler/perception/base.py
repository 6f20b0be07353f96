"""The `Detector` protocol, the result it returns and the error it raises."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeAlias

from PIL.Image import Image

from codebotler.core.errors import UserError
from codebotler.core.terminal import shortened

Box: TypeAlias = tuple[float, float, float, float]
"""The left, top, right and bottom edges of a box, as fractions of the image's size from its top left."""

MAX_LABEL_CHARACTERS = 200


@dataclass(frozen=True)
class Sighting:
    """The result of looking for something in an image.

    Args:
        found: whether the image shows the object or person.
        box: left, top, right and bottom of the clearest match, from 0 to 1 of the image; None if not found.
        score: the model's confidence, from 0 to 1. Scores from different models are not comparable.

    Raises:
        ValueError: the score or box is out of range.
    """

    found: bool
    box: Box | None
    score: float

    def __post_init__(self) -> None:
        if not 0 <= self.score <= 1:
            raise ValueError(f"the score {self.score} is not between 0 and 1")
        if self.box is None:
            return
        left, top, right, bottom = self.box
        if not (0 <= left < right <= 1 and 0 <= top < bottom <= 1):
            fix = "use left < right and top < bottom, each between 0 and 1"
            raise ValueError(f"the box {list(self.box)} is wrong; {fix}")


class Detector(Protocol):
    """Looks for objects and people in images, one at a time."""

    @property
    def name(self) -> str:
        """The model's name, such as `openai-chat:gpt-5.1` or `hf:PATH`."""

    def look(self, image: Image, label: str) -> Sighting:
        """Look for one object or person in an image.

        Args:
            image: the image, read with a function of `codebotler.perception`.
            label: what to look for, in plain words, such as `red mug`.

        Raises:
            UserError: the label is invalid.
            PerceptionError: the detector failed.
        """

    def close(self) -> None:
        """Release connections and memory. The detector cannot be used afterwards."""


class PerceptionError(Exception):
    """Raised when a detector fails. Its `sentence` gives the reason, without any API keys."""

    def __init__(self, sentence: str) -> None:
        super().__init__(sentence)
        self.sentence = sentence


def clean_label(label: str) -> str:
    """Return a label as one line. Raise UserError if it is empty, unprintable or over 200 characters."""
    words = " ".join(label.split())
    if not (0 < len(words) <= MAX_LABEL_CHARACTERS and words.isprintable()):
        limits = f"use 1 to {MAX_LABEL_CHARACTERS} printable characters"
        raise UserError(f'the label "{shortened(words, 40)}" is not valid; {limits}')
    return words
