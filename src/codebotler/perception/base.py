"""What all ways of looking for something in a picture have in common."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeAlias

from PIL.Image import Image

from codebotler.core.errors import UserError
from codebotler.core.terminal import visible

Box: TypeAlias = tuple[float, float, float, float]
"""Left, top, right and bottom as shares of a picture's width and height, from its upper left corner."""

LONGEST_LABEL = 200  # characters; a name needs fewer


@dataclass(frozen=True)
class Sighting:
    """What came of looking for something in a picture.

    Args:
        found: whether it is there.
        box: where, for the clearest one; None if it was not found.
        score: how sure it is that it is there, from 0 to 1; what a score means differs from model to model.

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
        if not all(0 <= share <= 1 for share in self.box):
            raise ValueError(f"the box is {list(self.box)}, but its numbers must be between 0 and 1")
        if not (left < right and top < bottom):
            raise ValueError(
                f"the box is {list(self.box)}, but left must be less than right, and top less than bottom"
            )


class Detector(Protocol):
    """Something that looks for things in pictures, one at a time."""

    @property
    def name(self) -> str:
        """What it is called, such as `openai-chat:gpt-5.1` or `hf:PATH`."""

    def look(self, image: Image, label: str) -> Sighting:
        """Look for something.

        Args:
            image: the picture, as `codebotler.perception.image` gives it.
            label: what to look for, in a few plain words such as `red mug`.

        Raises:
            UserError: the label is no name.
            PerceptionError: it could not be told whether it is there.
        """

    def close(self) -> None:
        """Give back what it holds."""


class PerceptionError(Exception):
    """It could not be told whether something is in a picture.

    Args:
        sentence: why; it quotes no keys.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(sentence)
        self.sentence = sentence


def named(label: str) -> str:
    """A label as it is looked for, on one line.

    Raises:
        UserError: it is empty, too long, or has characters that no name has.
    """
    words = " ".join(label.split())
    if not words:
        raise UserError("nothing is named that could be looked for; name an object")
    if len(words) > LONGEST_LABEL:
        raise UserError(
            f"the name of what is to be looked for has {len(words):,} characters; "
            f"name it in at most {LONGEST_LABEL}"
        )
    if not words.isprintable():
        raise UserError(f'"{visible(words)}" has characters that no name has; leave them out')
    return words
