"""The base class of text patterns, which caches their results."""

from __future__ import annotations

from abc import ABC, abstractmethod

from codebotler.core.cachedproperty import cached_property

MAX_CACHED_LENGTH, MAX_CACHED_TEXTS = 200, 1_000  # characters of a cached text, and number of texts


class Matcher(ABC):
    """A pattern that texts match or not."""

    def matches(self, text: str) -> bool:
        """Whether a string matches. The result is cached, since programs repeat texts."""
        known = self._known
        found = known.get(text)
        if found is None:
            found = self._matches(text)
            if len(text) <= MAX_CACHED_LENGTH:
                if len(known) >= MAX_CACHED_TEXTS:
                    known.clear()
                known[text] = found
        return found

    @abstractmethod
    def _matches(self, text: str) -> bool: ...

    @cached_property
    def _known(self) -> dict[str, bool]:
        return {}
