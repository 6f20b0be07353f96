"""Keys, which come from the environment, are kept out of whatever is shown, logged or written."""

from __future__ import annotations

import json
import logging
import os
import re
from urllib.parse import quote

SECRET = re.compile(r"key|token|secret|passw|credential", re.IGNORECASE)  # in the name of a variable
SHORTEST = 8  # what is shorter is no key, and would be found everywhere
SHAPED = re.compile(r"\b(?:sk|pk|gsk|xai|hf)[-_][\w*.-]{8,}|\bAIza[\w*-]{20,}|(?<=Bearer )\S{8,}")
HIDDEN = "[key removed]"
LOGGERS = (
    "openai",
    "httpx",
    "httpx2",
    "httpcore",
    "httpcore2",
    "pydantic_ai",
    "anthropic",
    "google_genai",
    "google",
    "groq",
    "botocore",
    "huggingface_hub",
    "urllib3",
    "asyncio",
)


def redacted(text: str) -> str:
    """A text without the values of variables that hold keys, and without what has the shape of a key."""
    for secret in _secrets():
        for spelling in (secret, json.dumps(secret)[1:-1], repr(secret)[1:-1], quote(secret, safe="")):
            text = text.replace(spelling, HIDDEN)
    return SHAPED.sub(HIDDEN, text)


def _secrets() -> list[str]:
    """The values of all variables that hold keys, the longest first, since one may contain another."""
    found = {
        value.strip() for name, value in os.environ.items() if SECRET.search(name) and len(value) >= SHORTEST
    }
    return sorted((value for value in found if len(value) >= SHORTEST), key=len, reverse=True)


class _Redaction(logging.Filter):
    """Takes keys out of records, which quote headers and bodies where somebody logs at DEBUG."""

    def filter(self, record: logging.LogRecord) -> bool:
        try:
            message = record.getMessage()
        except (TypeError, ValueError):
            return True  # logging itself says what is wrong with such a record, and shows no more than that
        record.msg, record.args = redacted(message), None
        if record.exc_info:
            record.exc_text = redacted(logging.Formatter().formatException(record.exc_info))
            record.exc_info = None
        return True


_REDACTION = _Redaction()


def guard_logs() -> None:
    """Take keys out of what the libraries that talk to models log; call it once they are imported."""
    known = logging.root.manager.loggerDict
    for name in [*LOGGERS, *(name for name in known if name.startswith(tuple(f"{top}." for top in LOGGERS)))]:
        logging.getLogger(name).addFilter(_REDACTION)
