"""Templates such as `Go to the {}.`, in whose holes any text may be."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from string import Formatter

from codebotler.core.cachedproperty import cached_property
from codebotler.core.text.unicode import normalize_text

MAX_PIECES, MAX_TEMPLATE_LENGTH = 20, 2_000
_HOLE = "\ud800"  # a lone surrogate


@dataclass(frozen=True)
class TextTemplate:
    """A text with gaps, such as `Go to the {}.`. Each stands for any text, even an empty one.

    Comparisons ignore case, Unicode composition and the amount of whitespace.

    Args:
        parts: the pieces around gaps, such as `("Go to the ", ".")`. A single piece has none, and two
            empty pieces match any text. A template with more than 20 pieces or 2,000 characters, or with
            the character U+D800, also matches any text. Adjacent gaps become one.

    Raises:
        ValueError: there are no parts.
    """

    parts: tuple[str, ...]

    def __post_init__(self) -> None:
        if not self.parts:
            raise ValueError("a text template needs at least one part")
        first, *rest = self.parts
        parts = (first, *filter(None, rest[:-1]), *rest[-1:])
        is_long = len(parts) > MAX_PIECES or sum(map(len, parts)) > MAX_TEMPLATE_LENGTH
        if is_long or any(_HOLE in part for part in parts):
            parts = ("", "")
        object.__setattr__(self, "parts", parts)

    @property
    def is_any(self) -> bool:
        """Whether every text matches this template."""
        return len(self.parts) > 1 and not any(map(str.strip, self._pieces))

    @cached_property
    def joined(self) -> str:
        """The template as text for comparisons: normalized, lower-case, with U+D800 for each gap."""
        return _comparable(_HOLE.join(self.parts))

    @cached_property
    def _pieces(self) -> list[str]:
        return self.joined.split(_HOLE)

    def matches(self, text: str) -> bool:
        """Whether a text consists of the pieces in order, with any text in place of each gap."""
        return _are_in_order(self._pieces, _comparable(text))

    def covers(self, other: TextTemplate) -> bool:
        """Whether this template matches every text that another template matches.

        The answer True is always right, but False may be wrong.
        """
        return _are_in_order(self._pieces, other.joined)

    @staticmethod
    def excess(templates: Iterable[TextTemplate], allowed: Iterable[TextTemplate]) -> list[TextTemplate]:
        """Return the templates that no template in `allowed` covers, such as texts outside a contract."""
        known = [*allowed]
        exact, open_ones = {one.joined for one in known}, [one for one in known if len(one.parts) > 1]
        left = [one for one in templates if one.joined not in exact]
        return [one for one in left if not any(each.covers(one) for each in open_ones)]

    def __str__(self) -> str:
        return "{}".join(part.replace("{", "{{").replace("}", "}}") for part in self.parts)

    @classmethod
    def parse(cls, text: str) -> TextTemplate:
        """Parse a template in which {} is a gap, and {{ and }} are braces.

        Raises:
            ValueError: a brace is neither doubled nor part of a gap.
        """
        parts = [""]
        for piece, field, form, conversion in Formatter().parse(text):
            parts[-1] += piece
            if field or form or conversion:
                raise ValueError("write {} for any text, and double any other brace, as in {{ and }}")
            if field is not None:
                parts.append("")
        return cls(tuple(parts))


ANY_TEXT = TextTemplate(("", ""))


@lru_cache(maxsize=256)  # a text is compared with many templates
def _comparable(text: str) -> str:
    """Return a text between two spaces, in which equal texts are spelled alike."""
    folded = normalize_text("NFD", normalize_text("NFD", text).casefold())
    return f" {' '.join(folded.split())} "


def _are_in_order(pieces: list[str], text: str) -> bool:
    """Whether a text begins with the first piece, ends with the last one, and has the others in between."""
    first, *others = pieces
    if not others:
        return text == first
    if not text.startswith(first):
        return False
    end = len(first)
    for piece in others[:-1]:
        start = text.find(piece, _start(piece, text, end))
        if start < 0:
            return False
        end = start + len(piece)
    return text.endswith(others[-1]) and len(text) - len(others[-1]) >= _start(others[-1], text, end)


def _start(piece: str, text: str, end: int) -> int:
    """Return where a piece may begin: around an empty hole, two spaces have become one."""
    return end - 1 if piece.startswith(" ") and text[end - 1] == " " else end
