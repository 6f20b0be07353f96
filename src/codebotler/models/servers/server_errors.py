"""Convert network and server failures to model errors without keys in their messages."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from codebotler.core.text.words import brief
from codebotler.models.base import ModelError
from codebotler.models.keys import redact

SUCCESS, FIRST_ERROR, SERVER_ERROR = 299, 400, 500
RETRYABLE_STATUSES = (408, 409, 425, 429)  # below 500
STATUS_HINTS = {
    401: "; is the right key in the environment?",
    403: "; is the right key in the environment?",
    404: "; are the model's name and the base URL right?",
}
CONNECT_ERROR = "ConnectError"  # the name in both httpx and httpx2; providers use either
MAX_ERROR_CHARACTERS = 300
FORBIDDEN = 403
PROMPT_STATUSES = (400, 413, 422)  # statuses that may be caused by this prompt
FILTER_WORDS = re.compile(
    r"content[\s_-]*(?:filter|management|policy|exists risk)|safety system|data_inspection|moderation"
    r"|flagged|usage polic|prohibited_content|敏感内容",
    re.IGNORECASE,
)
ACCOUNT_WORDS = re.compile(
    r"\b(?:credit|billing|balance|quota|payment|budget|expired|api[ _-]?key|permission|unauthori[sz]ed)",
    re.IGNORECASE,
)
"""Matches messages of errors that concern an account, not a prompt."""
RETRYABLE_WORDS = re.compile(
    r"rate_?limit|overload|unavailable|server_?error|internal|timeout", re.IGNORECASE
)
"""Matches the types and codes of temporary errors."""


def model_error(name: str, fault: str | Exception, *, is_temporary: bool) -> ModelError:
    """Build the error of the model `name` from a sentence, or from an exception and its first cause."""
    first: BaseException | None = fault if isinstance(fault, Exception) else None
    while first and first.__cause__:
        first = first.__cause__
    cause = "" if first is None or str(first) in str(fault) else f" ({error_text(first)})"
    return ModelError(f"{name}: {error_text(fault)}{cause}", is_temporary=is_temporary)


def connection_error(name: str, error: Exception, url: str | None) -> ModelError | None:
    """Build the error for a refused connection, or return None if the error has another cause."""
    failed = next((cause for cause in _causes(error) if type(cause).__name__ == CONNECT_ERROR), None)
    if failed is None:
        return None
    fix = "check the network" if url is None else "check the base URL, and whether the server is running"
    sentence = f"{name}: no connection to {url or 'its server'} ({error_text(failed)}); {fix}"
    return ModelError(sentence, is_temporary=True)


def find_model_error(error: Exception) -> ModelError | None:
    """Return the ModelError that a library wrapped in its own exception, or None if there is none."""
    return next((cause for cause in _causes(error) if isinstance(cause, ModelError)), None)


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def incomplete_error(name: str, *, has_begun: bool) -> ModelError:
    """Build the error for a stream that ended early, before or after the reply began."""
    nothing = "the server sent no completion; check the base URL"
    return model_error(name, "the reply was cut off" if has_begun else nothing, is_temporary=True)


def timeout_error(name: str, seconds: float) -> ModelError:
    """Build the error for a reply that did not arrive in time."""
    return ModelError(f"{name}: no complete reply arrived within {seconds:g} s", is_temporary=True)


def status_error(
    name: str, status: int, body: object, *, retry_after: float | None = None, is_permanent: bool = False
) -> ModelError:
    """Build the error for an HTTP status of 400 or more. `is_permanent` means that retries are useless."""
    message = f" ({text})" if (text := error_text(body)) else ""
    sentence = f"{name}: the server answered with status {status}{message}{STATUS_HINTS.get(status, '')}"
    is_temporary = not is_permanent and (status >= SERVER_ERROR or status in RETRYABLE_STATUSES)
    is_refusal = not is_permanent and status in PROMPT_STATUSES and not ACCOUNT_WORDS.search(message)
    return ModelError(sentence, is_temporary=is_temporary, retry_after=retry_after, is_refusal=is_refusal)


def error_in_reply(name: str, body: object) -> ModelError:
    """Build the error for a server that reports an error in `body`, but with a status of success."""
    fields = body if isinstance(body, Mapping) else {}
    code = next((fields[key] for key in ("code", "status") if fields.get(key)), None)
    if str(code).isdigit() and int(str(code)) > SUCCESS:
        return status_error(name, int(str(code)), body)
    is_temporary = bool(RETRYABLE_WORDS.search(f"{code} {fields.get('type')}"))
    sentence = f"{name}: the server sent an error: {error_text(body) or 'no text'}"
    return ModelError(sentence, is_temporary=is_temporary)


def is_filtered(status: int | None, body: object) -> bool:
    """Return whether an HTTP status and body say that a content filter rejected the request."""
    return status in {*PROMPT_STATUSES, FORBIDDEN} and FILTER_WORDS.search(str(body)) is not None


def error_text(body: object) -> str:
    """Return the message in a server's JSON, a text or an exception, as one short line without keys."""
    text = next(_messages(body), None) or ("" if body is None else str(body))
    return brief(redact(text), MAX_ERROR_CHARACTERS).rstrip(".")


def _messages(body: object) -> Iterator[str]:
    if isinstance(body, Mapping):
        for key in ("message", "error", "detail"):
            value = body.get(key)
            if isinstance(value, str) and value:
                yield value
            else:
                yield from _messages(value)
