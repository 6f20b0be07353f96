"""Settings of requests to a model: how it samples, how long a reply may be, and where it is served."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any
from urllib.parse import urlsplit

from codebotler.core.errors import UserError

HOTTEST = 100  # a higher temperature is a typo
PAPER_MAX_TOKENS = 512
"""The limit for a reply in the paper's experiments, in tokens; also for base models, which may never end."""
DEMANDED_MAX_TOKENS = 16_384
"""The limit for a chat reply where one is demanded and the user names none, in tokens."""


OURS = frozenset(
    ("model", "messages", "prompt", "stream", "stream_options", "temperature", "top_p", "seed", "max_tokens")
) | {"max_completion_tokens", "reasoning_effort"}
"""Fields of a request that no extra body may have, since they are set and recorded by themselves."""


@dataclass(frozen=True)
class SamplingSettings:
    """The settings of requests; what is None is not sent.

    Args:
        temperature: from 0 (always the likeliest token) up to about 2; None leaves it to the model.
        top_p: the share of likely tokens to sample from, above 0 and up to 1; None leaves it to the model.
        max_tokens: the limit for a reply, in tokens, at least 1; None leaves it to a chat model, and is
            512 for a base model.
        seed: fixes the random numbers, where a model takes a seed; reply number n gets `seed + n`.
        timeout: the limit for one whole request, in seconds.
        base_url: where the model is served, such as `http://localhost:8000/v1`; None for the provider's own.
        reasoning_effort: how much a reasoning model thinks, in its provider's words, such as `low`.
        extra_body: further fields of the JSON that is sent.

    Raises:
        UserError: a value is out of its range.
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
        if self.temperature is not None and not 0 <= self.temperature <= HOTTEST:
            raise UserError(f"the temperature is {self.temperature:g}, but must be between 0 and {HOTTEST}")
        if self.top_p is not None and not 0 < self.top_p <= 1:
            raise UserError(f"top-p is {self.top_p:g}, but it must be above 0 and at most 1")
        if self.max_tokens is not None and self.max_tokens < 1:
            raise UserError(f"the limit of tokens is {self.max_tokens}, but it must be at least 1")
        if not 0 < self.timeout < math.inf:
            raise UserError(f"the timeout is {self.timeout:g} seconds, but it must be above 0")
        if self.base_url is not None:
            _check_url(self.base_url)
        for name in OURS.intersection(self.extra_body or ()):
            raise UserError(f'the extra body has "{name}", which is set by itself; leave it out')

    def seed_of(self, number: int) -> int | None:
        """The seed for reply number `number`, counted from 0."""
        return None if self.seed is None else self.seed + number

    def for_base_model(self, name: str) -> SamplingSettings:
        """The settings with a base model's limit; raises UserError for what only chat models take."""
        if self.reasoning_effort is not None:
            raise UserError(f"{name} is a base model, which takes no reasoning effort")
        return replace(self, max_tokens=self.max_tokens or PAPER_MAX_TOKENS)


def _check_url(url: str) -> None:
    # Nothing of the URL is quoted: where it is mistyped, any part of it may be a password.
    if any(mark in url for mark in "@?#"):
        raise UserError(
            "the base URL has a user name, a password, a query or a fragment; leave them out, since the URL "
            "is recorded with a run, and put the key into the environment"
        )
    try:
        parts = urlsplit(url)
        is_valid = parts.scheme in {"http", "https"} and parts.hostname and parts.port != 0
    except ValueError:  # a bracket or a port that is none
        is_valid = False
    if not is_valid:
        raise UserError(
            "the base URL is not http:// or https:// with a host and port; "
            "write one like http://localhost:8000/v1"
        )
