"""Failures of a network or a server as errors of a model, without keys in their sentences."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from codebotler.core.words import brief
from codebotler.models.base import ModelError
from codebotler.models.keys import redacted

SUCCESS, FIRST_ERROR, SERVER_ERROR = 299, 400, 500
LATER = (408, 409, 425, 429)  # the statuses below 500 that may pass
MENDS = {
    401: "; is the right key in the environment?",
    403: "; is the right key in the environment?",
    404: "; are the model's name and the base URL right?",
}
NO_CONNECTION = "ConnectError"  # of httpx or httpx2, whichever a provider's library has
MOST = 300  # characters of what a server says
FORBIDDEN = 403
OF_PROMPT = (400, 413, 422)  # the statuses that may be about this one prompt
FILTER = re.compile(
    r"content[\s_-]*(?:filter|management|policy|exists risk)|safety system|data_inspection|moderation"
    r"|flagged|usage polic|prohibited_content|敏感内容",
    re.IGNORECASE,
)
ACCOUNT = re.compile(
    r"\b(?:credit|billing|balance|quota|payment|budget|expired|api[ _-]?key|permission|unauthori[sz]ed)",
    re.IGNORECASE,
)
"""Words of errors about an account rather than a prompt."""
PASSING = re.compile(r"rate_?limit|overload|unavailable|server_?error|internal|timeout", re.IGNORECASE)
"""Found in the types and codes of errors that may pass."""


def failure(name: str, what: str | Exception, *, may_pass: bool) -> ModelError:
    """The error for whatever went wrong with a model."""
    first: BaseException | None = what if isinstance(what, Exception) else None
    while first and first.__cause__:
        first = first.__cause__
    cause = "" if first is None or str(first) in str(what) else f" ({error_text(first)})"
    return ModelError(f"{name}: {error_text(what)}{cause}", may_pass=may_pass)


def unreachable(name: str, error: Exception, url: str | None) -> ModelError | None:
    """The error for a server that takes no connection; None if something else went wrong."""
    failed = next((cause for cause in _causes(error) if type(cause).__name__ == NO_CONNECTION), None)
    if failed is None:
        return None
    mend = "check the network" if url is None else "check that the server runs, and the base URL"
    sentence = f"{name}: no connection to {url or 'its server'} ({error_text(failed)}); {mend}"
    return ModelError(sentence, may_pass=True)


def model_error_in(error: Exception) -> ModelError | None:
    """The error that was raised while a reply was read, and that a library wrapped in its own."""
    return next((cause for cause in _causes(error) if isinstance(cause, ModelError)), None)


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def broken_off(name: str, *, begun: bool) -> ModelError:
    """The error for a stream that ends too early, before or after the reply has begun."""
    nothing = "the server sent no completion; check the base URL"
    return failure(name, "the reply was cut off" if begun else nothing, may_pass=True)


def timed_out(name: str, seconds: float) -> ModelError:
    """The error for a reply that did not come in time."""
    return ModelError(f"{name}: no complete reply arrived within {seconds:g} s", may_pass=True)


def refused(
    name: str, status: int, body: object, *, retry_after: float | None = None, hopeless: bool = False
) -> ModelError:
    """The error for a status of 400 or more; `hopeless` says that it will not pass, whatever the status."""
    said = f" ({text})" if (text := error_text(body)) else ""
    sentence = f"{name}: the server answered with status {status}{said}{MENDS.get(status, '')}"
    may_pass = not hopeless and (status >= SERVER_ERROR or status in LATER)
    is_refusal = not hopeless and status in OF_PROMPT and not ACCOUNT.search(said)
    return ModelError(sentence, may_pass=may_pass, retry_after=retry_after, is_refusal=is_refusal)


def error_in_reply(name: str, body: object) -> ModelError:
    """The error that a server sends in the place of a reply, with a status of success."""
    said = body if isinstance(body, Mapping) else {}
    code = next((said[key] for key in ("code", "status") if said.get(key)), None)
    if str(code).isdigit() and int(str(code)) > SUCCESS:
        return refused(name, int(str(code)), body)
    may_pass = bool(PASSING.search(f"{code} {said.get('type')}"))
    return ModelError(f"{name}: the server sent an error: {error_text(body) or 'no text'}", may_pass=may_pass)


def is_filtered(status: int | None, body: object) -> bool:
    """Whether a refused request was refused by a filter of contents, by the word of the server."""
    return status in {*OF_PROMPT, FORBIDDEN} and FILTER.search(str(body)) is not None


def error_text(said: object) -> str:
    """What a server or a library says, in one short line without keys."""
    text = next(_messages(said), None) or ("" if said is None else str(said))
    return brief(redacted(text), MOST).rstrip(".")


def _messages(said: object) -> Iterator[str]:
    if isinstance(said, Mapping):
        for key in ("message", "error", "detail"):
            value = said.get(key)
            if isinstance(value, str) and value:
                yield value
            else:
                yield from _messages(value)
