"""The messages between client and server.

No model has a custom validator, since openenv cannot send its errors and would end the session.
"""

from typing import Any, Literal, TypeAlias

from openenv.core.env_server.types import Action, Observation, State
from pydantic import BaseModel, Field

from roboeval.training.rollouts import Components

EpisodeMode: TypeAlias = Literal["program", "agent"]


class Message(BaseModel):
    """A message of the prompt."""

    role: Literal["system", "user", "assistant"]
    content: str


class CodebotlerAction(Action):
    """The output of a policy: a program or, in a mission of an agent, a call or the answer that ends it.

    Args:
        completion: a reply that contains the program.
        program: the source of a program.
        tool: the name of the tool to call.
        arguments: the arguments of the call, also as JSON text.
        answer: the policy's last words.
    """

    completion: str | None = None
    program: str | None = None
    tool: str | None = None
    arguments: dict[str, Any] | str = Field(default_factory=dict)
    answer: str | None = None


class CodebotlerObservation(Observation):
    """The prompt after a reset, the result after a call, and the reward and its components at the end.

    Args:
        instruction: the task in words; empty after a step.
        messages: the whole prompt, which ends with the instruction; empty after a step.
        tools: the tools of an agent, in OpenAI's format; empty after a step.
        result: the result of the last call.
        components: the components of the reward, each from 0 to 1; none before the end.
    """

    instruction: str = ""
    messages: list[Message] = Field(default_factory=list)
    tools: list[dict[str, Any]] = Field(default_factory=list)
    result: str = ""
    components: Components | None = None


class CodebotlerState(State):
    """The task of a session, identified as for `trained_task`.

    Args:
        split: the split of the task.
        family: the family of the task.
        seed: the seed of the task; the seed passed to reset counts from the start of the split.
        prompt_index: the phrasing, from 0.
        mode: whether the policy writes a program or acts as an agent.
        world: the world of an agent; none for a program, which runs in all worlds.
    """

    split: str | None = None
    family: str | None = None
    seed: int | None = None
    prompt_index: int | None = None
    mode: EpisodeMode = "program"
    world: int | None = None
