"""The client of the environment's server."""

from typing import Any

from openenv.core.client_types import StepResult
from openenv.core.env_client import EnvClient

from codebotler_openenv.models import CodebotlerAction, CodebotlerObservation, CodebotlerState


class CodebotlerEnv(EnvClient[CodebotlerAction, CodebotlerObservation, CodebotlerState]):
    """A session with a server: `reset` gives a prompt, `step` the reward of a program or a call's result.

    Both raise a RuntimeError if the server reports an error or if a response has no reward.
    """

    def _step_payload(self, action: CodebotlerAction) -> dict[str, Any]:
        return action.model_dump(mode="json", exclude_none=True)

    def _parse_result(self, payload: dict[str, Any]) -> StepResult[CodebotlerObservation]:
        reward, done = payload["reward"], payload["done"]
        observation = CodebotlerObservation.model_validate(
            {**payload["observation"], "reward": reward, "done": done}
        )
        return StepResult(observation, reward, done, payload.get("metadata"))

    def _parse_state(self, payload: dict[str, Any]) -> CodebotlerState:
        return CodebotlerState.model_validate(payload)
