"""API keys: read from the environment, and removed from whatever is shown, logged or written."""

from __future__ import annotations

import json
import logging
import os
import re
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from urllib.parse import quote

from codebotler.core.errors import UserError

SECRET = re.compile(r"(?:key|token|secret|password|passwd|credential)s?(?:_|$)", re.IGNORECASE)
"""Found in the names of variables that hold keys, but not in TOKENIZERS_PARALLELISM."""

SHORTEST = 8  # shorter values stay in replies, where they may be parts of names
SHORTEST_IN_ERRORS = 3  # also in logs
SHAPED = r"\b(?:sk|pk|gsk|xai|hf)[-_][\w*.-]{8,}|\bAIza[\w*-]{20,}|(?<=Bearer )\S{8,}"
HIDDEN = "[key removed]"
LOGGERS = (
    *("openai", "httpx", "httpx2", "httpcore", "httpcore2", "pydantic_ai", "anthropic", "google_genai"),
    *("google", "groq", "botocore", "huggingface_hub", "urllib3", "asyncio"),
)


def key_in(variable: str) -> str | None:
    """The key in a variable of the environment, if there is one; a UserError if no header can hold it."""
    key = os.environ.get(variable, "")
    if not key.strip():
        return None
    if not (key.isascii() and key.isprintable() and key == key.strip()):
        raise UserError(
            f"the key in {variable} cannot be sent: it has a line break, a space at either end, or a "
            "character outside printable ASCII; set it again"
        )
    return key


@contextmanager
def blank_is_unset(variables: Iterable[str]) -> Iterator[None]:
    """Take blank variables out of the environment meanwhile, for libraries that only test for presence."""
    blank = {name: os.environ.pop(name) for name in variables if not os.environ.get(name, "x").strip()}
    try:
        yield
    finally:
        os.environ.update(blank)


def redacted(text: str) -> str:
    """An error or a line of a log without the values of key variables and without the shapes of keys."""
    # HIDDEN comes first, so that what stands for a long key is not taken for a short one.
    rest = "|".join([re.escape(HIDDEN), SHAPED, *_secrets(SHORTEST_IN_ERRORS)])
    return re.sub(rest, HIDDEN, without_keys(text))


def without_keys(text: str) -> str:
    """A reply without the long values of key variables; what only looks like a key may be a name in it."""
    secrets = _secrets(SHORTEST)
    return re.sub("|".join(secrets), HIDDEN, text) if secrets else text


def _secrets(shortest: int) -> list[str]:
    """Patterns of the values of key variables, the longest first, for one may contain another."""
    values = {value.strip() for name, value in os.environ.items() if SECRET.search(name)}
    spellings = {
        spelling
        for value in values
        if len(value) >= shortest
        for spelling in (
            value,
            json.dumps(value)[1:-1],
            repr(value)[1:-1],
            quote(value, safe="", errors="surrogateescape"),
        )
    }
    return [re.escape(spelling) for spelling in sorted(spellings, key=len, reverse=True)]


class _Redaction(logging.Filter):
    def filter(self, record: logging.LogRecord) -> bool:
        try:
            message = record.getMessage()
        except (TypeError, ValueError):
            return True  # logging itself reports such a record, and shows no more than its format
        record.msg, record.args = redacted(message), None
        if record.exc_info:
            record.exc_text = redacted(logging.Formatter().formatException(record.exc_info))
            record.exc_info = None
        return True


_REDACTION = _Redaction()


def guard_logs() -> None:
    """Take keys out of the logs of the libraries that talk to models, and silence their warnings.

    Call it once they are imported. Our own notes name the settings that a model does not take.
    """
    warnings.filterwarnings("ignore", module="|".join(LOGGERS))
    known = logging.root.manager.loggerDict
    for name in [*LOGGERS, *(name for name in known if name.startswith(tuple(f"{top}." for top in LOGGERS)))]:
        logging.getLogger(name).addFilter(_REDACTION)
