"""A conversation in which a model carries out one mission, turn by turn."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Protocol

from codebotler.models.base import Reply
from codebotler.prompts import Prompt, PromptMessage
from codebotler.prompts.tools import CallingMessage, ResultMessage, ToolCall, ToolPrompt
from roboeval.evaluation.agents.mission import AgentMission
from roboeval.evaluation.runs.endings import TOKEN_LIMIT, TURN_LIMIT

MAX_REASONING = 200_000
"""The characters of reasoning that a row keeps; the log of turns has all of it."""


@dataclass(frozen=True)
class TurnLimits:
    """When a mission ends at the latest."""

    turns: int  # the number of replies
    tokens: int | None = None  # of all turns, as far as the model counts them


class Conversation(Protocol):
    """A mission that goes on as long as it has a prompt."""

    @property
    def prompt(self) -> Prompt | None:
        """The next request to the model; None after the end."""

    def add(self, reply: Reply) -> None:
        """Do what a reply says. The robot is simulated, so the same replies always lead to the same end."""

    def data(self) -> dict[str, Any]:
        """Return the mission as entries of a row of completions.jsonl."""


@dataclass
class Turns:
    """The replies of one conversation."""

    limits: TurnLimits
    replies: list[Reply] = field(default_factory=list)

    @property
    def ending(self) -> str | None:
        """The limit that is reached, or None."""
        if len(self.replies) >= self.limits.turns:
            return TURN_LIMIT
        used = sum(reply.usage.total for reply in self.replies)
        return TOKEN_LIMIT if self.limits.tokens is not None and used >= self.limits.tokens else None

    def data(self) -> dict[str, Any]:
        """Return what all turns together took, and the end of the conversation."""
        last, latencies = self.replies[-1], [reply.latency_s or 0 for reply in self.replies]
        return {
            "no_program": last.no_program,
            "finish_reason": last.finish_reason,
            "usage": _total_usage([asdict(reply.usage) for reply in self.replies]),
            "latency_s": round(sum(latencies), 3),
            "raw_reply": last.text,
            "reasoning": "\n\n".join(filter(None, (r.reasoning for r in self.replies)))[:MAX_REASONING],
            "turns": len(self.replies),
        }


class AgentConversation:
    """Lets a model call skills. Every reply is one call, or else the end of the mission."""

    def __init__(self, mission: AgentMission, prompt: ToolPrompt, limits: TurnLimits) -> None:
        self.mission = mission
        self.result: str | None = None  # of the calls in the last reply
        self._turns, self._first = Turns(limits), prompt
        self._later: list[PromptMessage] = []

    @property
    def prompt(self) -> Prompt | None:
        """The request for the next call."""
        if self.mission.ending is not None:
            return None
        return replace(self._first, messages=(*self._first.messages, *self._later))

    def add(self, reply: Reply) -> None:
        """Make the call of a reply, or end the mission."""
        self._turns.replies.append(reply)
        self.result = None
        if reply.no_program is not None:
            self.mission.end(reply.no_program)
        elif not reply.calls:
            self.mission.answer(reply.text)
        else:
            self.result = result = self._make(reply.calls)
            self._later.append(CallingMessage("assistant", reply.text, reply.turn))
            self._later += [ResultMessage("tool", result, call) for call in reply.calls]
            if self.mission.ending is None and (limit := self._turns.ending) is not None:
                self.mission.end(limit)

    def data(self) -> dict[str, Any]:
        """Return the mission as entries of a row."""
        return mission_data(self.mission) | self._turns.data()

    def _make(self, calls: Sequence[ToolCall]) -> str:
        if len(calls) == 1:
            return self.mission.call(calls[0].name, calls[0].arguments)
        return self.mission.refuse_several([call.name for call in calls])


def mission_data(mission: AgentMission) -> dict[str, Any]:
    """Return the entries of a row that say what was done, and how it ended."""
    return {
        "program": mission.program,
        "ending": mission.ending,
        "tool_errors": dict(sorted(mission.mistakes.items())),
    }


def _total_usage(usages: list[Mapping[str, int | None]]) -> dict[str, int | None]:
    total: Counter[str] = Counter()
    known = {name for usage in usages for name, count in usage.items() if count is not None}
    for usage in usages:
        total.update({name: count or 0 for name, count in usage.items()})
    return {name: total[name] if name in known else None for name in usages[0]}
