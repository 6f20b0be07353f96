"""What a client and the server exchange.

Nothing here has a validator of its own: openenv cannot send its error, and would end the session.
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
    """What a policy wrote: a completion, or the program alone.

    Args:
        completion: a reply in which the program is looked for.
        program: the source of a program, judged as it is.
    """

    completion: str | None = None
    program: str | None = None


class CodebotlerObservation(Observation):
    """The prompt after a reset; after the step, the reward and its parts.

    Args:
        instruction: what a person asks the robot to do; empty after the step.
        messages: the whole prompt, which ends with the instruction; empty after the step.
        components: the parts of the reward, each from 0 to 1; none after a reset.
    """

    instruction: str = ""
    messages: list[Message] = Field(default_factory=list)
    components: Components | None = None


class CodebotlerState(State):
    """Which task a session has, as `roboeval.training.trained_task` takes it.

    Args:
        split: which the task belongs to.
        family: of the task.
        seed: of the task; the seed that was passed to reset counts from the beginning of the split.
        prompt_index: which phrasing, counted from 0.
    """

    split: str | None = None
    family: str | None = None
    seed: int | None = None
    prompt_index: int | None = None
