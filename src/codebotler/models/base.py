"""The `Model` protocol, its replies and its errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any, Protocol, TypeAlias

from codebotler.models.no_program import NoProgram, classify_reply
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt
from codebotler.prompts.extract import read_reply
from codebotler.prompts.tools import ToolCall

TextListener: TypeAlias = Callable[[str], None]
"""A function that receives each piece of a reply as it arrives."""


@dataclass(frozen=True)
class Usage:
    """The token counts of a request. Counts that the model does not report are None."""

    input_tokens: int | None = None
    output_tokens: int | None = None  # including reasoning tokens
    reasoning_tokens: int | None = None

    @property
    def total(self) -> int:
        """The sum of the known input and output tokens."""
        return (self.input_tokens or 0) + (self.output_tokens or 0)


@dataclass(frozen=True)
class Reply:
    """A model's reply: its text, the program extracted from it, its token counts, and why it ended."""

    text: str = field(repr=False)  # the complete reply with tool calls, or the message of a refusal
    program: str = field(repr=False)  # the program in the reply; it may not parse
    usage: Usage  # the token counts
    latency_s: float | None  # the seconds from the request to the end of the reply; None if not measured
    finish_reason: str | None  # why the server ended the reply, such as `stop` or `length`; None if unknown
    reasoning: str = field(default="", repr=False)  # the model's reasoning, where the server shows it
    no_program: NoProgram | None = None  # why there is no program; None if there is, or may be, a program
    calls: tuple[ToolCall, ...] = ()  # the calls that the model requests, if it was offered tools
    turn: str = field(default="", repr=False)  # if it was offered tools: the reply as its library writes it

    def data(self) -> dict[str, Any]:
        """Return the reply as plain data, for a line of a JSON Lines file."""
        return {
            "program": self.program,
            "no_program": self.no_program,
            "finish_reason": self.finish_reason,
            "usage": asdict(self.usage),
            "latency_s": None if self.latency_s is None else round(self.latency_s, 3),
            "raw_reply": self.text,
            "reasoning": self.reasoning,
        }


def make_reply(
    text: str,
    usage: Usage,
    latency_s: float | None,
    finish_reason: str | None,
    *,
    opening: Prompt | None = None,
    reasoning: str = "",
    known_kind: NoProgram | None = None,
    has_answer: bool = True,
) -> Reply:
    """Extract the program from a model's text, and build a `Reply`.

    `opening` is the prompt that a base model continues, None for a chat model. `known_kind` is the server's
    own reason for a missing program. `has_answer` is False for a refusal, tool calls or an error message.
    """
    answer = text if has_answer else ""
    code = answer if opening is None else opening.program_from(answer)
    found = read_reply(code, continues=opening is not None)
    has_code = found.has_code and has_answer
    why = classify_reply(text, found.program, finish_reason, has_code=has_code, known_kind=known_kind)
    thoughts = "\n".join(filter(None, (reasoning, found.reasoning)))
    return Reply(text, found.program, usage, latency_s, finish_reason, thoughts, why)


def ignore_text(_piece: str) -> None:
    """Ignore a piece of a reply. This is the default `on_text` of `Model.reply`."""


class Model(Protocol):
    """A language model that writes programs on request.

    Several requests may run at the same time, all in one event loop. Each of them can be cancelled.
    """

    @property
    def name(self) -> str:
        """The model's name on the command line and in runs, such as `openai-chat:gpt-5.1`."""

    @property
    def settings(self) -> SamplingSettings:
        """The settings of all requests. Settings that the provider does not support are None."""

    async def reply(self, prompt: Prompt, *, number: int, on_text: TextListener = ignore_text) -> Reply:
        """Request one reply.

        Args:
            prompt: the prompt to answer.
            number: the number of the reply among the replies to this prompt, from 0.
            on_text: called with each piece of text, with reasoning between `<think>` and `</think>`. If a
                request is repeated after an error, the pieces start again from the beginning.

        Raises:
            ModelError: no complete reply arrived.
        """

    async def close(self) -> None:
        """Release connections and memory. Call this only when no request is running."""


class ModelError(Exception):
    """Raised if a model did not reply. A reply without a program is not an error.

    Args:
        sentence: the cause and, if known, the fix. It must not contain API keys.
        is_temporary: whether the same request may succeed later.
        retry_after: how many seconds to wait, if the server asks for a delay, else None.
        is_refusal: whether the server rejected this prompt, rather than failing.
    """

    def __init__(
        self, sentence: str, *, is_temporary: bool, retry_after: float | None = None, is_refusal: bool = False
    ) -> None:
        super().__init__(sentence)
        self.sentence, self.is_temporary, self.retry_after = sentence, is_temporary, retry_after
        self.is_refusal = is_refusal

    def __reduce__(self) -> tuple[object, ...]:
        return partial(type(self), is_temporary=self.is_temporary), (self.sentence,), vars(self)


class BudgetSpentError(Exception):
    """Raised instead of making a request if the token budget is used up."""

    def __init__(self, budget: int, used: int) -> None:
        self.budget, self.used = budget, used
        self.sentence = f"the token budget of {budget:,} is used up: {used:,} tokens were used"
        super().__init__(self.sentence)

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.budget, self.used), vars(self)
