"""Who may do what: tokens, roles, the cookie, and how often a wrong token may be tried."""

from __future__ import annotations

import hashlib
import hmac
import secrets
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum

from codebotler.core.errors import UserError

TRIES, WINDOW = 10, 60.0
"""So many wrong tokens may come from an address in so many seconds."""

MOST_ADDRESSES = 10_000


class Role(StrEnum):
    """What somebody may do: an operator everything, the robot's face only to speak and to ask."""

    OPERATOR = "operator"
    FACE = "face"


class TooManyTriesError(Exception):
    """An address has tried too many wrong tokens; the right one is not looked at either, for a while."""


SHORTEST_TOKEN = 16


def new_token() -> str:
    """A token that nobody guesses."""
    return secrets.token_urlsafe(24)


@dataclass(frozen=True)
class Access:
    """Knows the tokens.

    Args:
        operator: the token of operators; None where nobody needs one.
        face: the token of the robot's face.
        unguessable: whose tokens were made here, so that nobody guesses them; these open at any time.
        now: a clock that never goes back, in seconds.
    """

    operator: str | None = field(default_factory=new_token)
    face: str = field(default_factory=new_token)
    unguessable: frozenset[Role] = frozenset()
    now: Callable[[], float] = time.monotonic
    _wrong: dict[str, deque[float]] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    @classmethod
    def asked_for(
        cls, operator: str | None, face: str | None, *, open_to_all: bool, is_loopback: bool
    ) -> Access:
        """What a user wants.

        Args:
            operator: the token of operators; None for a new one.
            face: that of the face; None for a new one.
            open_to_all: whether operators need none.
            is_loopback: whether only this machine gets there.

        Raises:
            UserError: that would let in whoever should not be.
        """
        if open_to_all and (operator or face or not is_loopback):
            raise UserError("--no-token is only for this machine; leave out --host and all tokens")
        for token in (operator, face):
            if token is not None and len(token) < SHORTEST_TOKEN:
                raise UserError(
                    f"this token can be guessed; take {SHORTEST_TOKEN} characters or more, or none"
                )
        if operator is not None and operator == face:
            raise UserError("the face's token would open the operator's page; take another one")
        long = frozenset(
            role for role, token in ((Role.OPERATOR, operator), (Role.FACE, face)) if token is None
        )
        return cls(None if open_to_all else operator or new_token(), face or new_token(), unguessable=long)

    def of_token(self, token: str, address: str) -> Role | None:
        """The role that a token gives; None for a wrong one, which is counted.

        Args:
            token: that somebody showed.
            address: from which.

        Raises:
            TooManyTriesError: too many wrong ones came from there.
        """
        with self._lock:
            role = self._of(token, lambda known: known)
            if role in self.unguessable:
                return role
            wrong = self._recent(address)
            if len(wrong) >= TRIES:
                raise TooManyTriesError
            if role is None:
                if address not in self._wrong and len(self._wrong) >= MOST_ADDRESSES:
                    self._wrong.pop(next(iter(self._wrong)))
                self._wrong.setdefault(address, wrong).append(self.now())
            return role

    def of_cookie(self, value: str) -> Role | None:
        """The role that a cookie gives; None for a wrong one."""
        return self._of(value, _in_cookie)

    def cookie(self, role: Role) -> str:
        """What stands in the cookie of a role: not the token itself, which opens more than one browser."""
        return _in_cookie(self.face if role is Role.FACE else self.operator or "")

    def _of(self, shown: str, form: Callable[[str], str]) -> Role | None:
        tokens = {Role.OPERATOR: self.operator, Role.FACE: self.face}
        for role, token in tokens.items():
            if token and hmac.compare_digest(form(token).encode(), shown.encode(errors="replace")):
                return role
        return None

    def _recent(self, address: str) -> deque[float]:
        wrong = self._wrong.get(address, deque(maxlen=TRIES))
        while wrong and wrong[0] <= self.now() - WINDOW:
            wrong.popleft()
        return wrong


def _in_cookie(token: str) -> str:
    return hmac.new(token.encode(), b"codebotler cookie", hashlib.sha256).hexdigest()
