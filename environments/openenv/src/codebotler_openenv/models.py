"""The messages between client and server.

No model has a custom validator, since openenv cannot send its errors and would end the session.
"""

from typing import Literal

from openenv.core.env_server.types import Action, Observation, State
from pydantic import BaseModel, Field

from roboeval.training.rollouts import Components


class Message(BaseModel):
    """A message of the prompt."""

    role: Literal["system", "user", "assistant"]
    content: str


class CodebotlerAction(Action):
    """The output of a policy: a completion, or only the program.

    Args:
        completion: a reply that contains the program.
        program: the source of a program.
    """

    completion: str | None = None
    program: str | None = None


class CodebotlerObservation(Observation):
    """The prompt after a reset; after the step, the reward and its components.

    Args:
        instruction: the task in words; empty after the step.
        messages: the whole prompt, which ends with the instruction; empty after the step.
        components: the components of the reward, each from 0 to 1; none after a reset.
    """

    instruction: str = ""
    messages: list[Message] = Field(default_factory=list)
    components: Components | None = None


class CodebotlerState(State):
    """The task of a session, identified as for `trained_task`.

    Args:
        split: the split of the task.
        family: the family of the task.
        seed: the seed of the task; the seed passed to reset counts from the start of the split.
        prompt_index: the phrasing, from 0.
    """

    split: str | None = None
    family: str | None = None
    seed: int | None = None
    prompt_index: int | None = None
