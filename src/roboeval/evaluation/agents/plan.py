"""Plans the missions of a run in which a model acts, instead of writing one program for all worlds."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, TypeAlias

from codebotler.checking.contracts.file import contract_yaml
from codebotler.models.base import ModelError, Reply
from codebotler.prompts import Prompt, template_hash
from codebotler.prompts.tools import agent_prompt, agent_template_hash
from codebotler.simulator.guard.contract import Contract
from roboeval.evaluation.agents.conversation import (
    AgentConversation,
    Conversation,
    ReplanConversation,
    TurnLimits,
)
from roboeval.evaluation.agents.mission import AgentMission
from roboeval.evaluation.generating.requests import Ask, GenerationPlan
from roboeval.evaluation.runs.completions import CompletionKey, row_for
from roboeval.evaluation.runs.endings import SERVER_REJECTED

AgentMode: TypeAlias = Literal["agent", "replan"]
DEFAULT_TURNS: dict[AgentMode, int] = {"agent": 300, "replan": 4}  # some worlds need 100 looks and waits


@dataclass(frozen=True, kw_only=True)
class AgentPlan(GenerationPlan):
    """Plans an agent's missions: `num_completions` for each prompt in each world of its task.

    Args:
        mode: `agent` if the model calls skills, or `replan` if it writes a program and, after each failure,
            another program for the rest of the mission.
        limits: the numbers of replies and tokens after which a mission ends.
        contract: a limit on what the robot may do in each mission, or None.
    """

    mode: AgentMode
    limits: TurnLimits
    contract: Contract | None = None

    has_turns: ClassVar[bool] = True

    def keys(self) -> list[CompletionKey]:
        """Return the keys of all missions. With 3 worlds, index 3 is the second mission in world 0."""
        first = GenerationPlan(self.suite, self.tasks, 1)
        prompts = [(task, prompt) for task, prompt, _ in first.keys()]  # noqa: SIM118 - a plan is no mapping
        return [
            (task, prompt, sample * self._worlds(task) + world)
            for sample in range(self.num_completions)
            for task, prompt in prompts
            for world in range(self._worlds(task))
        ]

    def describe(self) -> dict[str, Any]:
        """Return the entries of run.json that the plan determines, such as `mode` and `max_turns`."""
        is_agent = self.mode == "agent"
        hashed = agent_template_hash if is_agent else template_hash
        return {
            "template": hashed(self.suite.skills),
            "mode": self.mode,
            "max_turns": self.limits.turns,
            **({} if self.limits.tokens is None else {"max_mission_tokens": self.limits.tokens}),
            **({} if self.contract is None else {"contract": contract_yaml(self.contract)}),
        }

    async def complete(
        self, key: CompletionKey, model: str, ask: Ask, earlier: Sequence[Reply] = ()
    ) -> dict[str, Any]:
        """Let the model carry out a mission, or continue it after `earlier` replies, and return its row."""
        conversation = self.begin(key)
        for reply in earlier:
            await asyncio.to_thread(conversation.add, reply)
        while (prompt := conversation.prompt) is not None:
            try:
                reply = await ask(prompt)
            except ModelError as error:
                # A server may refuse all first requests, or all that contain the result of a call.
                if not error.is_refusal or len(conversation.replies) <= 1:
                    raise
                conversation.end(SERVER_REJECTED, error.sentence)
            else:
                await asyncio.to_thread(conversation.add, reply)
        where = {"mode": self.mode, "world": self.world(key)}
        return row_for(key, self.instruction(key), model, where | conversation.data())

    def begin(self, key: CompletionKey) -> Conversation:
        """Create the conversation for the mission `key` (task, prompt and index of the completion)."""
        kind = AgentConversation if self.mode == "agent" else ReplanConversation
        return kind(self.begin_mission(key), self.prompt(key), self.limits)

    def begin_mission(self, key: CompletionKey) -> AgentMission:
        """Create the mission `key`, in its world and with the requirements of its prompt."""
        contracts = () if self.contract is None else (self.contract,)
        scenario = self.suite.tasks[key[0]].scenarios[self.world(key)].asked_by(key[1])
        return AgentMission(self.suite, scenario, contracts)

    def prompt(self, key: CompletionKey) -> Prompt:
        """Return the model prompt with which the mission `key` begins."""
        if self.mode == "replan":
            return super().prompt(key)
        rules, skills = self.suite.house_sentences, self.suite.skills
        return agent_prompt(self.instruction(key), rules=rules, skills=skills)

    def world(self, key: CompletionKey) -> int:
        """Return the index of the world in which the mission `key` takes place."""
        return key[2] % self._worlds(key[0])

    def _worlds(self, task: str) -> int:
        return len(self.suite.tasks[task].scenarios)
