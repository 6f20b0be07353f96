"""What can go wrong between a model and its server, in sentences that quote no keys."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime

from codebotler.models.base import ModelError
from codebotler.models.redaction import redacted

BROKEN_OFF = "the reply broke off before its end"
NO_REPLY = "the server sent nothing that is a reply; is the base URL right?"
SERVER_ERROR = 500
LATER = (408, 409, 425, 429)  # of the statuses below 500, those that may pass
MENDS = {
    401: "; is the right key in the environment?",
    403: "; is the right key in the environment?",
    404: "; are the model's name and the base URL right?",
}
MOST = 300  # characters of what a server says


def fault(name: str, what: str | Exception, *, may_pass: bool) -> ModelError:
    """The error for what went wrong with a model, told in the words of whoever noticed."""
    said = brief(what)
    cause = _first_cause(what) if isinstance(what, Exception) else ""
    return ModelError(f"{name}: {said}{cause and f' ({cause})'}", may_pass=may_pass)


def unreachable(name: str, error: Exception, url: str | None) -> ModelError | None:
    """The error for a server that does not even take a connection; None if something else went wrong.

    Args:
        name: the model.
        error: what was noticed.
        url: where the server was looked for; None for the model's own.
    """
    failed = next((cause for cause in _causes(error) if type(cause).__name__ == NO_CONNECTION), None)
    if failed is None:
        return None
    where = "its server" if url is None else url
    mend = "is there a network?" if url is None else "is the server running, and the base URL right?"
    return ModelError(f"{name}: no connection to {where} ({brief(failed)}); {mend}", may_pass=True)


def told_before(error: Exception) -> ModelError | None:
    """The error that was raised while a reply was read, which a library may have wrapped in its own."""
    return next((cause for cause in _causes(error) if isinstance(cause, ModelError)), None)


NO_CONNECTION = "ConnectError"  # of httpx, whichever of its versions a provider's library has


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def _first_cause(error: BaseException) -> str:
    first = error
    while first.__cause__ is not None:
        first = first.__cause__
    return "" if str(first) in str(error) else brief(first)


def broken_off(name: str, *, begun: bool) -> ModelError:
    """The error for a stream without an end.

    Args:
        name: the model.
        begun: whether something of the reply had come.
    """
    return fault(name, BROKEN_OFF if begun else NO_REPLY, may_pass=True)


def late(name: str, seconds: float) -> ModelError:
    """The error for a reply that did not come in time."""
    return ModelError(f"{name}: no whole reply came within {seconds:g} s", may_pass=True)


def refused(
    name: str, status: int, body: object, *, retry_after: float | None = None, hopeless: bool = False
) -> ModelError:
    """The error for an answer with a status of 400 or more.

    Args:
        name: the model.
        status: the status.
        body: what the answer says, parsed if it could be.
        retry_after: how many seconds the server wants to be left in peace.
        hopeless: whether to try again is no use, although the status alone would say so.
    """
    said = brief(body)
    sentence = (
        f"{name}: the server answered with status {status}{said and f' ({said})'}{MENDS.get(status, '')}"
    )
    may_pass = not hopeless and (status >= SERVER_ERROR or status in LATER)
    return ModelError(sentence, may_pass=may_pass, retry_after=retry_after)


def brief(said: object) -> str:
    """What a server or a library says, in one line that is not too long."""
    text = next(_messages(said), None) or ("" if said is None else str(said))
    line = " ".join(redacted(text).split()).rstrip(".")
    return line if len(line) <= MOST else f"{line[:MOST]} ..."


def _messages(said: object) -> Iterator[str]:
    if isinstance(said, Mapping):
        for key in ("message", "error", "detail"):
            value = said.get(key)
            if isinstance(value, str) and value:
                yield value
            else:
                yield from _messages(value)


def retry_after(headers: Mapping[str, str]) -> float | None:
    """How many seconds a server wants to be left in peace, as `Retry-After` says: a number or a date."""
    said = headers.get("retry-after")
    if said is None:
        return None
    try:
        seconds = float(said)
    except ValueError:
        pass
    else:
        return max(0.0, seconds) if math.isfinite(seconds) else None
    try:
        until = parsedate_to_datetime(said)
    except ValueError:
        return None
    until = until if until.tzinfo else until.replace(tzinfo=UTC)
    return max(0.0, (until - datetime.now(UTC)).total_seconds())
