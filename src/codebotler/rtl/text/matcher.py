"""`Matcher`: what a text of an event is compared with, which remembers its answers."""

from __future__ import annotations

from abc import ABC, abstractmethod

from codebotler.core.cachedproperty import cached_property
from codebotler.core.trace import Names

SHORT_TEXT, MOST_REMEMBERED_TEXTS = 200, 1_000  # characters of a text that is remembered, and how many texts


class Matcher(ABC):
    """Something that a text matches or not."""

    def matches(self, text: str) -> bool:
        """Whether a text matches, or one of several names; programs say the same texts again and again."""
        if isinstance(text, Names):
            return self._matches_names(text)
        known = self._known
        found = known.get(text)
        if found is None:
            found = self._matches(text)
            if len(text) <= SHORT_TEXT:
                if len(known) >= MOST_REMEMBERED_TEXTS:
                    known.clear()
                known[text] = found
        return found

    @abstractmethod
    def _matches(self, text: str) -> bool: ...

    def _matches_names(self, names: Names) -> bool:
        return any(map(self.matches, names.each))

    @cached_property
    def _known(self) -> dict[str, bool]:
        return {}
