"""Settings for requests to a model: sampling, the length of replies, and the server."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any
from urllib.parse import urlsplit

from codebotler.core.errors import UserError

MAX_TEMPERATURE = 100  # a higher temperature must be a typo
PAPER_MAX_TOKENS = 512
"""The paper's limit for a reply, in tokens, and also the default for base models, which may never stop."""
CHAT_MAX_TOKENS = 16_384
"""The token limit for chat replies if the provider requires a limit and the user gives none."""

RESERVED_FIELDS = frozenset(
    ("model", "messages", "prompt", "stream", "stream_options", "temperature", "top_p", "seed", "max_tokens")
) | {"max_completion_tokens", "reasoning_effort"}
"""Fields that an extra body must not contain, because other settings control them."""


@dataclass(frozen=True)
class SamplingSettings:
    """The settings of requests to a model. Settings that are None are not sent.

    Args:
        temperature: from 0 (always the likeliest token) up to about 2, or None for the model's default.
        top_p: the share of likely tokens to sample from, above 0 and up to 1; None for the model's default.
        max_tokens: the limit for a reply, at least 1, or None for the default of a chat model, or 512 for a
            base model.
        seed: the random seed, if the model supports one. Reply number n gets `seed + n`.
        timeout: the limit for a complete request, in seconds.
        base_url: the server's address, such as `http://localhost:8000/v1`, or None for the provider's own.
        reasoning_effort: the provider's name for how much a model reasons, such as `low`.
        extra_body: additional fields for the JSON body of each request.

    Raises:
        UserError: a value is out of range.
    """

    temperature: float | None = 0.2
    top_p: float | None = 0.95
    max_tokens: int | None = None
    seed: int | None = None
    timeout: float = 600.0
    base_url: str | None = None
    reasoning_effort: str | None = None
    extra_body: Mapping[str, Any] | None = field(default=None, hash=False)

    def __post_init__(self) -> None:
        if self.temperature is not None and not 0 <= self.temperature <= MAX_TEMPERATURE:
            fix = f"it must be from 0 to {MAX_TEMPERATURE}"
            raise UserError(f"the temperature is {self.temperature:g}; {fix}")
        if self.top_p is not None and not 0 < self.top_p <= 1:
            raise UserError(f"top-p is {self.top_p:g}; it must be above 0 and at most 1")
        if self.max_tokens is not None and self.max_tokens < 1:
            raise UserError(f"the token limit is {self.max_tokens}; it must be at least 1")
        if not 0 < self.timeout < math.inf:
            raise UserError(f"the timeout is {self.timeout:g} seconds; it must be above 0 and finite")
        if self.base_url is not None:
            _check_url(self.base_url)
        for name in RESERVED_FIELDS.intersection(self.extra_body or ()):
            raise UserError(f'the extra body contains "{name}", which CodeBotler sets itself; remove it')

    def seed_of(self, number: int) -> int | None:
        """Return the seed for reply `number`, counted from 0, or None if no seed is set."""
        return None if self.seed is None else self.seed + number

    def for_base_model(self, name: str) -> SamplingSettings:
        """Return settings with a token limit for a base model. Raise UserError for a reasoning effort."""
        if self.reasoning_effort is not None:
            raise UserError(f"{name} is a base model and does not support a reasoning effort; remove it")
        return replace(self, max_tokens=self.max_tokens or PAPER_MAX_TOKENS)


def _check_url(url: str) -> None:
    # Never quote the URL: in a mistyped URL, any part may be a password.
    is_valid = False
    with suppress(ValueError):  # an unmatched bracket, or an invalid port
        parts = urlsplit(url)
        is_valid = parts.scheme in {"http", "https"} and bool(parts.hostname) and parts.port != 0
    if not is_valid or any(mark in url for mark in "@?#"):
        form = "must be http:// or https:// with a host and port, as in http://localhost:8000/v1"
        mend = "remove any password or query (no @, ? or #), and put keys into the environment"
        raise UserError(f"the base URL {form}; {mend}")
