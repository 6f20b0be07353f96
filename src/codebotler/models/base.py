"""The `Model` protocol, and what every model takes, returns and raises."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any, Protocol, TypeAlias

from codebotler.models.no_program import NoProgram, is_cut_off, why_no_program
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt
from codebotler.prompts.extract import read_reply

Heard: TypeAlias = Callable[[str], None]


@dataclass(frozen=True)
class Usage:
    """The tokens that a request took; None where the model does not count them.

    Args:
        input_tokens: the tokens of the prompt.
        output_tokens: the tokens of the reply, with its reasoning.
        reasoning_tokens: the tokens of the reasoning alone.
    """

    input_tokens: int | None = None
    output_tokens: int | None = None
    reasoning_tokens: int | None = None

    @property
    def total(self) -> int:
        """All known tokens."""
        return (self.input_tokens or 0) + (self.output_tokens or 0)


@dataclass(frozen=True)
class Reply:
    """A model's reply.

    Args:
        text: the reply as it came, with calls of tools as text; of a refused request what the server said.
        program: the program in it; any text, which need not even parse.
        usage: the tokens that it took.
        latency_s: the seconds from the request to the end of the reply; None where nobody measured them.
        finish_reason: why it ended, as the server said it, such as `stop` or `length`; None if it said
            nothing.
        reasoning: what the model thought before it answered, where the server shows it.
        no_program: why it holds no program; None if it does, or if that is uncertain.
    """

    text: str = field(repr=False)
    program: str = field(repr=False)
    usage: Usage
    latency_s: float | None
    finish_reason: str | None
    reasoning: str = field(default="", repr=False)
    no_program: NoProgram | None = None

    @property
    def is_cut_off(self) -> bool:
        """Whether it ended at the limit of tokens, whether or not its program is whole."""
        return is_cut_off(self.finish_reason)

    def data(self) -> dict[str, Any]:
        """The reply as rows of JSON have it."""
        return {
            "program": self.program,
            "no_program": self.no_program,
            "finish_reason": self.finish_reason,
            "usage": asdict(self.usage),
            "latency_s": None if self.latency_s is None else round(self.latency_s, 3),
            "raw_reply": self.text,
            "reasoning": self.reasoning,
        }


def reply_from(
    text: str,
    usage: Usage,
    latency_s: float | None,
    finish_reason: str | None,
    *,
    opening: Prompt | None = None,
    reasoning: str = "",
    said: NoProgram | None = None,
    has_answer: bool = True,
) -> Reply:
    """A reply with its program.

    Args:
        text: the reply as it came.
        usage: the tokens that it took.
        latency_s: the seconds that it took; None where nobody measured them.
        finish_reason: why it ended, as the server said it.
        opening: the prompt that a base model goes on from; None for a chat model.
        reasoning: what the server sent as the model's thoughts, apart from the text.
        said: the kind of reply without a program that the server made known in another way.
        has_answer: whether the text is the model's answer, in which a program may be.
    """
    answer = text if has_answer else ""
    found = read_reply(
        answer if opening is None else opening.program_from(answer), continues=opening is not None
    )
    has_code = found.has_code and has_answer
    why = why_no_program(text, found.program, finish_reason, has_code=has_code, said=said)
    thoughts = "\n".join(filter(None, (reasoning, found.reasoning)))
    return Reply(text, found.program, usage, latency_s, finish_reason, thoughts, why)


def unheard(_piece: str) -> None:
    """Ignore a piece of a reply."""


class Model(Protocol):
    """Anything that writes programs on request.

    It takes several requests at a time, all from one event loop; a cancelled request is given up.
    """

    @property
    def name(self) -> str:
        """The name on a command line and in a run, such as `openai-chat:gpt-5.1`."""

    @property
    def settings(self) -> SamplingSettings:
        """The settings that it really sends: what its provider does not take is None."""

    async def reply(self, prompt: Prompt, *, number: int, heard: Heard = unheard) -> Reply:
        """Request one reply.

        Args:
            prompt: the request.
            number: which sample of this prompt it is, counted from 0.
            heard: called with each piece of the text as it arrives, and of thoughts between `<think>` and
                `</think>`; from the beginning again when the request is repeated after an error.

        Raises:
            ModelError: no whole reply arrived.
        """

    async def close(self) -> None:
        """Release its connections and memory; no request may be under way."""


class ModelError(Exception):
    """A model did not reply.

    A reply without a program is none of these: it counts as a completion.

    Args:
        sentence: what went wrong and, where it helps, the mend; it holds no keys.
        may_pass: whether the same request may succeed later.
        retry_after: the seconds to wait that the server asks for, if it does.
        is_refusal: whether the server refused this prompt, rather than failed.
    """

    def __init__(
        self, sentence: str, *, may_pass: bool, retry_after: float | None = None, is_refusal: bool = False
    ) -> None:
        super().__init__(sentence)
        self.sentence, self.may_pass, self.retry_after = sentence, may_pass, retry_after
        self.is_refusal = is_refusal

    def __reduce__(self) -> tuple[object, ...]:
        made = partial(
            type(self), may_pass=self.may_pass, retry_after=self.retry_after, is_refusal=self.is_refusal
        )
        return made, (self.sentence,), vars(self)


class BudgetSpentError(Exception):
    """The token budget is spent, so no further request is made.

    Args:
        budget: the allowed tokens.
        used: the used tokens.
    """

    def __init__(self, budget: int, used: int) -> None:
        self.budget, self.used = budget, used
        self.sentence = f"the token budget of {budget:,} is spent: {used:,} tokens were used"
        super().__init__(self.sentence)

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.budget, self.used), vars(self)
