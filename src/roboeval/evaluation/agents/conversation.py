"""Talks with a model that carries out one mission, by calls of skills or by one program after another."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from codebotler.core.errors import VIOLATION
from codebotler.core.trace import Outcome, RunError, Status
from codebotler.missions.storage.past import MissionPast
from codebotler.models.base import Reply
from codebotler.prompts import Prompt
from codebotler.prompts.tools import CallingMessage, ResultMessage
from codebotler.simulator.pool import shared_pool
from roboeval.evaluation.agents.mission import AgentMission
from roboeval.evaluation.recovery import rest_prompt
from roboeval.evaluation.runs.endings import ERROR, OUTSIDE_CONTRACT, TIMEOUT, TOKEN_LIMIT, TURN_LIMIT

MAX_REASONING = 200_000
"""The number of characters of reasoning that completions.jsonl keeps; turns.jsonl keeps all of it."""


@dataclass(frozen=True)
class TurnLimits:
    """Limits on an agent's mission: the maximum numbers of replies (turns) and tokens (None: no limit)."""

    turns: int  # the number of replies
    tokens: int | None = None  # of all turns, as far as the model counts them


class Conversation(ABC):
    """Conducts a mission with a model: send `prompt`, `add` the reply, and repeat until `prompt` is None."""

    def __init__(self, mission: AgentMission, prompt: Prompt, limits: TurnLimits) -> None:
        self.mission, self.limits = mission, limits
        self.prompt: Prompt | None = prompt  # the next request to the model; None after the end
        self.replies: list[Reply] = []
        self.result: str | None = None  # the result of the calls in the last reply

    def add(self, reply: Reply) -> None:
        """Execute the skill call or program in a reply. End the mission if the reply contains neither."""
        self.replies.append(reply)
        self.result = None
        if reply.no_program is None:
            self.prompt = self._act(reply)
        else:
            self.end(reply.no_program)

    def end(self, ending: str, why: str = "") -> None:
        """End the mission with one of `ENDINGS`, such as `Rejected`. Add the comment `why` to the program."""
        self.prompt = None
        self.mission.end(ending, why)

    @abstractmethod
    def _act(self, reply: Reply) -> Prompt | None:
        """Make the call of a reply, or run its program. Return the next request, or None after the end."""

    @property
    def limit(self) -> str | None:
        """The limit that the mission has reached, `TurnLimit` or `TokenLimit`, or else None."""
        if len(self.replies) >= self.limits.turns:
            return TURN_LIMIT
        used = sum(reply.usage.total for reply in self.replies)
        return TOKEN_LIMIT if self.limits.tokens is not None and used >= self.limits.tokens else None

    def data(self) -> dict[str, Any]:
        """Return the mission as entries of a row of completions.jsonl, such as `program` and `ending`."""
        last, latencies = self.replies[-1], [reply.latency_s or 0 for reply in self.replies]
        return {
            **mission_data(self.mission),
            "no_program": last.no_program,
            "finish_reason": last.finish_reason,
            "usage": _total_usage([asdict(reply.usage) for reply in self.replies]),
            "latency_s": round(sum(latencies), 3),
            "raw_reply": last.text,
            "reasoning": "\n\n".join(filter(None, (r.reasoning for r in self.replies)))[:MAX_REASONING],
            "turns": len(self.replies),
        }


class AgentConversation(Conversation):
    """Lets a model call skills, one in each reply. A reply without a call ends the mission."""

    def _act(self, reply: Reply) -> Prompt | None:
        if not reply.calls:
            self.mission.answer(reply.text)
            return None
        if len(reply.calls) == 1:
            self.result = result = self.mission.call(reply.calls[0].name, reply.calls[0].arguments)
        else:
            self.result = result = self.mission.refuse_several([call.name for call in reply.calls])
        if self.mission.ending is None and self.limit is not None:
            self.mission.end(self.limit)
        if self.mission.ending is not None:
            return None
        assert self.prompt is not None, "a reply answers a prompt"
        said = CallingMessage("assistant", reply.text, reply.turn)
        results = [ResultMessage("tool", result, call) for call in reply.calls]
        return replace(self.prompt, messages=(*self.prompt.messages, said, *results))


def mission_data(mission: AgentMission) -> dict[str, Any]:
    """Return a mission's `program`, its `ending`, and `tool_errors`, which counts mistakes by kind."""
    mistakes = dict(sorted(mission.mistakes.items()))
    return {"program": mission.program, "ending": mission.ending, "tool_errors": mistakes}


def _total_usage(usages: list[Mapping[str, int | None]]) -> dict[str, int | None]:
    known = {name: [n for usage in usages if (n := usage[name]) is not None] for name in usages[0]}
    return {name: sum(counts) if counts else None for name, counts in known.items()}


# --- programs instead of calls


class ReplanConversation(Conversation):
    """Runs a model's program and, after each error, asks for another program for the rest of the mission."""

    def __init__(self, mission: AgentMission, prompt: Prompt, limits: TurnLimits) -> None:
        super().__init__(mission, prompt, limits)
        self._first = prompt

    def _act(self, reply: Reply) -> Prompt | None:
        """Run a reply's program where the last one has stopped."""
        pool, robot, settings = shared_pool(), self.mission.robot, self.mission.suite.settings
        # The mission is judged as one program, so its programs share the limit.
        left = settings.limits.calls - robot.skill_calls
        robot.settings = replace(settings, limits=replace(settings.limits, calls=left))
        outcome = pool.submit(lambda: pool.here().run_on(reply.program, robot)).result()
        if outcome.error is None:
            self.mission.answer("")
            return None
        self.mission.mistakes[OUTSIDE_CONTRACT if robot.is_outside else outcome.error.kind] += 1
        if not _may_go_on(outcome) or self.limit is not None:
            self._end_like(outcome, outcome.error)
            return None
        why = f"{outcome.error.kind}: {outcome.error.message}"
        past = MissionPast("", self._first.instruction, "", reply.program, why, robot.trace, robot.place)
        return rest_prompt(past, self._first)

    def _end_like(self, outcome: Outcome, error: RunError) -> None:
        """End the mission as the last program ended."""
        mission = self.mission
        if mission.robot.is_outside:
            mission.end(OUTSIDE_CONTRACT)
        elif error.kind == VIOLATION:
            mission.end(ERROR)
        elif outcome.status is Status.ROBOT_ERROR:
            mission.give_up("")
        elif outcome.status is Status.TIMEOUT:
            mission.end(TIMEOUT)
        else:
            if error.kind != "Exception":  # Python's own classes may take more than a text, or quote it again
                mission.robot.lines.append(f"class {error.kind}(Exception): pass")
            mission.robot.lines.append(f"raise {error.kind}({error.message!r})")
            mission.end(ERROR)


def _may_go_on(outcome: Outcome) -> bool:
    """Whether a program failed, but neither broke a rule nor reached a limit."""
    is_failure = outcome.status in {Status.ROBOT_ERROR, Status.PYTHON_ERROR, Status.KILLED}
    return is_failure and outcome.error is not None and outcome.error.kind != VIOLATION
