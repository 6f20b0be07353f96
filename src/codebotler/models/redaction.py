"""Keys, which come from the environment, are kept out of whatever is shown, logged or written."""

from __future__ import annotations

import json
import logging
import os
import re
from urllib.parse import quote

SECRET = re.compile(r"(?:key|token|secret|password|passwd|credential)s?(?:_|$)", re.IGNORECASE)
"""What the names of variables that hold keys contain; TOKENIZERS_PARALLELISM is none."""

SHORTEST = 8  # what is shorter is found everywhere, and would spoil programs
SHORTEST_TOLD = 3  # in errors and logs, where nothing is spoilt
SHAPED = r"\b(?:sk|pk|gsk|xai|hf)[-_][\w*.-]{8,}|\bAIza[\w*-]{20,}|(?<=Bearer )\S{8,}"
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
    """An error or a line of a log without keys.

    Removed are the values of variables that hold keys, even short ones, and what has the shape of a key.
    """
    return _rest(SHORTEST_TOLD).sub(HIDDEN, without_keys(text))


def without_keys(text: str) -> str:
    """A reply without the values of variables that hold keys.

    What only has the shape of a key stays, and so does what is short: both may be names in a program.
    """
    secrets = _secrets(SHORTEST)
    return re.sub("|".join(secrets), HIDDEN, text) if secrets else text


def _rest(shortest: int) -> re.Pattern[str]:
    """What is still to be removed once long keys are; what stands for those is left as it is."""
    return re.compile("|".join([re.escape(HIDDEN), SHAPED, *_secrets(shortest)]))


def _secrets(shortest: int) -> list[str]:
    """Patterns of the values of variables that hold keys, the longest first, for one may contain another."""
    values = {value.strip() for name, value in os.environ.items() if SECRET.search(name)}
    spellings = {
        spelling
        for value in values
        if len(value) >= shortest
        for spelling in (value, json.dumps(value)[1:-1], repr(value)[1:-1], _quoted(value))
    }
    return [re.escape(spelling) for spelling in sorted(spellings, key=len, reverse=True)]


def _quoted(value: str) -> str:
    return quote(value, safe="", errors="surrogateescape")


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
