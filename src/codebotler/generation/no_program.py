"""A reply without a program: how people and the model read about it, and which limit may help."""

from __future__ import annotations

from dataclasses import dataclass, field

from codebotler.core.words import brief
from codebotler.models.base import Reply
from codebotler.models.no_program import IN_WORDS, NoProgram
from codebotler.models.sampling import DEMANDED_MAX_TOKENS, SamplingSettings

RAISED = 4  # times the limit at which a reply was cut off
MOST_QUOTED = 200  # characters of a refusal


@dataclass(frozen=True)
class ProgramlessReply:
    """A reply without a program.

    Args:
        kind: why there is none.
        sentence: the same for people.
        text: the reply as it came.
        reasoning: what the model thought before it answered.
        higher_limit: a limit that may be high enough, in tokens; None where no limit was the reason.
    """

    kind: NoProgram
    sentence: str
    text: str = field(repr=False)
    reasoning: str = field(repr=False)
    higher_limit: int | None

    @property
    def may_listen(self) -> bool:
        """Whether the model may answer with a program when it reads what was wrong."""
        return self.kind != "filtered"


def programless(reply: Reply, settings: SamplingSettings) -> ProgramlessReply | None:
    """Describe a reply without a program; None if it holds one.

    Args:
        reply: the reply.
        settings: those with which it was requested.
    """
    kind = reply.no_program
    if kind is None:
        return None
    sentence, higher = IN_WORDS[kind], None
    if kind == "cut-off":
        limit = settings.max_tokens or reply.usage.output_tokens
        higher = RAISED * limit if limit else DEMANDED_MAX_TOKENS
        sentence = f"The reply was cut off at {limit:,} tokens." if limit else sentence
    elif kind == "refusal" and reply.text.strip():
        sentence = f"The model refused: {brief(reply.text, MOST_QUOTED)}"
    return ProgramlessReply(kind, sentence, reply.text, reply.reasoning, higher)
