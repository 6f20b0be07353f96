"""Describe a reply without a program for people and for the model."""

from __future__ import annotations

from dataclasses import dataclass, field

from codebotler.core.text.words import brief
from codebotler.models.base import Reply
from codebotler.models.no_program import NO_PROGRAM_SENTENCES, NoProgram
from codebotler.models.sampling import CHAT_MAX_TOKENS, SamplingSettings

LIMIT_FACTOR = 4  # the suggested limit is this many times the one that cut off a reply
MAX_REFUSAL_CHARACTERS = 200


@dataclass(frozen=True)
class ProgramlessReply:
    """A model's reply that contains no program, and the reason why."""

    kind: NoProgram  # why there is no program
    sentence: str  # the reason for people
    text: str = field(repr=False)  # the complete reply
    reasoning: str = field(repr=False)  # the model's reasoning
    higher_limit: int | None  # a limit that may be high enough, in tokens; None if no limit was reached

    @property
    def can_repair(self) -> bool:
        """Whether it may help to ask again with the reason. False if a content filter stopped the reply."""
        return self.kind != "filtered"


def describe_programless(reply: Reply, settings: SamplingSettings) -> ProgramlessReply | None:
    """Return why a reply to a request with these settings has no program, or None if it has one."""
    kind = reply.no_program
    if kind is None:
        return None
    sentence, higher = NO_PROGRAM_SENTENCES[kind], None
    if kind == "cut-off":
        limit = settings.max_tokens or reply.usage.output_tokens
        higher = LIMIT_FACTOR * limit if limit else CHAT_MAX_TOKENS
        sentence = f"The reply was cut off at {limit:,} tokens." if limit else sentence
    elif kind == "refusal" and reply.text.strip():
        sentence = f"The model refused: {brief(reply.text, MAX_REFUSAL_CHARACTERS)}"
    return ProgramlessReply(kind, sentence, reply.text, reply.reasoning, higher)
