"""An episode: a prompt, one program or the calls of an agent, and a reward."""

import secrets
import uuid
from typing import Any

from openenv.core.env_server.interfaces import Environment
from openenv.core.env_server.types import EnvironmentMetadata

from codebotler import __version__
from codebotler.core.errors import UserError
from codebotler.core.text.words import listed
from codebotler.simulator.worker import EngineError
from codebotler_openenv.models import (
    CodebotlerAction,
    CodebotlerObservation,
    CodebotlerState,
    EpisodeMode,
    Message,
)
from roboeval.suites.families.suite import FIRST_SEEDS
from roboeval.suites.families.tasks import family_names
from roboeval.training.missions import TrainingMission, load_missions
from roboeval.training.prompts import load_prompts, program_in
from roboeval.training.rollouts import Components, Rollout, judge

SEEDS = FIRST_SEEDS["validation"] - FIRST_SEEDS["train"]
"""The number of seeds of a split; larger ones belong to another split."""


class CodebotlerEnvironment(Environment[CodebotlerAction, CodebotlerObservation, CodebotlerState]):
    """The episodes of one session; openenv calls `reset` and `step` in a thread of the session."""

    SUPPORTS_CONCURRENT_SESSIONS = True

    def __init__(self) -> None:
        super().__init__()
        self._state = CodebotlerState()
        self._mission: TrainingMission | None = None  # Only agents have missions.

    def reset(
        self,
        seed: int | None = None,
        episode_id: str | None = None,
        *,
        split: str = "train",
        family: str | None = None,
        mode: EpisodeMode = "program",
        **others: Any,  # noqa: ANN401 - options of any type
    ) -> CodebotlerObservation:
        """Begin an episode and return its prompt.

        Args:
            seed: the task of the split, from 0 to 999,999,999; random by default.
            episode_id: a name for the episode; by default, a new one.
            split: `train`, `validation` or `test`, which share no task.
            family: a single family; all families by default.
            mode: `program` if one step takes a program, or `agent` if each step takes a call of a tool.
            others: other options are errors.

        Raises:
            UserError: the split, family, mode or option does not exist, or the seed is out of range.
        """
        self._state, self._mission = CodebotlerState(), None  # A failed reset leaves no task.
        if others:
            raise UserError(
                f"reset takes seed, episode_id, split, family and mode, but not {listed(sorted(others))}"
            )
        if mode not in {"program", "agent"}:
            raise UserError(f'there is no mode "{mode}"; use program or agent')
        if family is not None and family not in family_names():  # Clients may not name files.
            raise UserError(f'there is no family "{family}"; use {listed(family_names())}')
        number = secrets.randbelow(SEEDS) if seed is None else _validate(seed)
        load = load_prompts if mode == "program" else load_missions
        (row,) = load(split, count=1, seed=number, only=() if family is None else (family,))
        self._mission = TrainingMission.begin(row) if mode == "agent" else None
        self._state = CodebotlerState(
            episode_id=episode_id or str(uuid.uuid4()),
            split=split,
            family=row["family"],
            seed=row["seed"],
            prompt_index=row["prompt_index"],
            mode=mode,
            world=row.get("world"),
        )
        messages = [Message(**message) for message in row["prompt"]]
        return CodebotlerObservation(
            instruction=messages[-1].content, messages=messages, tools=row.get("tools", [])
        )

    def step(
        self,
        action: CodebotlerAction,
        timeout_s: float | None = None,  # noqa: ARG002 - each run has its own limit
        **_: Any,  # noqa: ANN401 - options of any type
    ) -> CodebotlerObservation:
        """Judge a program, which ends the episode, or make a call of an agent.

        Raises:
            UserError: there is no open task, or the action has not exactly one of the parts of its mode.
            EngineError: the engine failed; there is no reward, and the episode continues, so try again.
        """
        if self._mission is not None:
            return self._act(self._mission, action)
        found = self._judge(_program(action))
        self._state.step_count = 1
        return CodebotlerObservation(components=found, reward=found.reward, done=True)

    @property
    def state(self) -> CodebotlerState:
        """The current task, and the number of steps."""
        return self._state

    def get_metadata(self) -> EnvironmentMetadata:
        """Return the description that openenv shows."""
        return EnvironmentMetadata(
            name="codebotler_env",
            description="Robot programs from plain words, run in simulated worlds, judged by temporal logic.",
            version=__version__,
        )

    def _act(self, mission: TrainingMission, action: CodebotlerAction) -> CodebotlerObservation:
        """Make a call in a mission, or end it with an answer."""
        if mission.is_over:
            raise UserError("this mission is over; call reset for another one")
        if (action.tool is None) == (action.answer is None):
            raise UserError("an action of an agent has either a tool or an answer")
        result = ""
        if action.tool is not None:
            result = mission.call(action.tool, action.arguments)
        elif action.answer is not None:
            mission.answer(action.answer)
        self._state.step_count += 1
        if not mission.is_over:
            return CodebotlerObservation(result=result)
        found = mission.components
        return CodebotlerObservation(result=result, components=found, reward=found.reward, done=True)

    def _judge(self, program: str) -> Components:
        """Judge a program for the task of this session."""
        state = self._state
        if state.family is None or state.seed is None or state.prompt_index is None:
            raise UserError("there is no task yet; call reset before step, in the same session of /ws")
        if state.step_count:
            raise UserError("this episode is over after its one step; call reset for another task")
        try:
            (found,) = judge([Rollout(state.family, state.seed, state.prompt_index, program)])
        except EngineError as error:  # A client receives only the text.
            raise EngineError(f"EngineError: {error}; there is no reward") from error
        return found


def _validate(seed: int) -> int:
    """Return the seed of a client if it is valid."""
    if not isinstance(seed, int) or not 0 <= seed < SEEDS:
        raise UserError(f"the seed is {seed!r}, but must be a whole number from 0 to {SEEDS - 1:,}")
    return seed


def _program(action: CodebotlerAction) -> str:
    """Extract the program of an action."""
    if action.program is not None and action.completion is None:
        return action.program
    if action.completion is not None and action.program is None:
        return program_in(action.completion)
    raise UserError("an action has either a completion or a program")
