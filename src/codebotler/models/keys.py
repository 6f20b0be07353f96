"""Read API keys from the environment, and remove them from output, logs and files."""

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

SECRET_NAME = re.compile(r"(?:key|token|secret|password|passwd|credential)s?(?:_|$)", re.IGNORECASE)
"""Matches the names of variables that hold keys, but not TOKENIZERS_PARALLELISM."""
MIN_SECRET = 8  # shorter values are kept in replies, where they may be parts of names
MIN_SECRET_IN_ERRORS = 3  # the limit for error messages and logs
KEY_SHAPES = r"\b(?:sk|pk|gsk|xai|hf)[-_][\w*.-]{8,}|\bAIza[\w*-]{20,}|(?<=Bearer )\S{8,}"
KEY_REMOVED = "[key removed]"
CLIENT_LOGGERS = (
    *("openai", "httpx", "httpx2", "httpcore", "httpcore2", "pydantic_ai", "anthropic", "google_genai"),
    *("google", "groq", "botocore", "huggingface_hub", "urllib3", "asyncio"),
)


def read_key(variable: str) -> str | None:
    """Return the key in an environment variable, or None if it is blank. Raise UserError if it is invalid."""
    key = os.environ.get(variable, "")
    if not key.strip():
        return None
    if not (key.isascii() and key.isprintable() and key == key.strip()):
        flaws = "a line break, a space at an end, or a non-ASCII character"
        raise UserError(f"the key in {variable} has {flaws}; set it again")
    return key


@contextmanager
def hide_variables(variables: Iterable[str]) -> Iterator[None]:
    """Remove environment variables during a `with` block, so that libraries cannot read them."""
    before = {name: os.environ.pop(name) for name in variables if name in os.environ}
    try:
        yield
    finally:
        os.environ.update(before)


def redact(text: str) -> str:
    """Return an error or log line with `[key removed]` in place of keys and of text that looks like a key."""
    # KEY_REMOVED comes first, since otherwise a short secret could match a part of it.
    rest = "|".join([re.escape(KEY_REMOVED), KEY_SHAPES, *_secrets(MIN_SECRET_IN_ERRORS)])
    return re.sub(rest, KEY_REMOVED, remove_keys(text))


def remove_keys(text: str) -> str:
    """Return a reply with `[key removed]` in place of the environment's keys of 8 or more characters."""
    secrets = _secrets(MIN_SECRET)
    return re.sub("|".join(secrets), KEY_REMOVED, text) if secrets else text


def _secrets(shortest: int) -> list[str]:
    """Return regexes for the values of key variables, longest first, since one may contain another."""
    values = {value.strip() for name, value in os.environ.items() if SECRET_NAME.search(name)}
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
            return True  # logging prints only the format of an invalid record
        record.msg, record.args = redact(message), None
        if record.exc_info:
            record.exc_text = redact(logging.Formatter().formatException(record.exc_info))
            record.exc_info = None
        return True


_REDACTION = _Redaction()


def guard_logs() -> None:
    """Remove keys from client libraries' logs, and silence their warnings. Call this after importing them."""
    warnings.filterwarnings("ignore", module="|".join(CLIENT_LOGGERS))  # CodeBotler gives better ones
    prefixes = tuple(f"{name}." for name in CLIENT_LOGGERS)
    children = [name for name in logging.root.manager.loggerDict if name.startswith(prefixes)]
    for name in (*CLIENT_LOGGERS, *children):
        logging.getLogger(name).addFilter(_REDACTION)
