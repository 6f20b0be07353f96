"""Robot programs and missions of agents for TRL: data sets of prompts, and reward functions for its trainers.

Train a policy on `reward`; log the other functions, which return its components, with weight 0. Results are
cached, so the components cost nothing extra.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from datasets import Dataset  # type: ignore[import-untyped]  # datasets has no types

from codebotler_trl.missions import MissionEnvironment
from roboeval.training.missions import load_missions as mission_rows
from roboeval.training.prompts import PolicyReply, PromptForm, program_in
from roboeval.training.prompts import load_prompts as rows_of
from roboeval.training.rollouts import Components, Rollout, judge

__all__ = [
    "MissionEnvironment",
    "load_missions",
    "load_prompts",
    "parses",
    "passed",
    "requirements",
    "reward",
    "without_errors",
]


def load_prompts(
    split: str = "train",
    *,
    count: int = 1_000,
    seed: int = 0,
    only: Sequence[str] = (),
    form: PromptForm = "chat",
) -> Dataset:
    """Create a data set of prompts; see `roboeval.training.prompts.load_prompts`.

    The rewards need its columns `family`, `seed`, `prompt_index` and `opening`, which a trainer passes on
    unless `remove_unused_columns` is set.
    """
    return Dataset.from_list(rows_of(split, count=count, seed=seed, only=only, form=form))


def load_missions(
    split: str = "train", *, count: int = 1_000, seed: int = 0, only: Sequence[str] = ()
) -> Dataset:
    """Create a data set of missions for `MissionEnvironment`; see `roboeval.training.missions.load_missions`.

    It has no column `tools`, because a trainer reads them from the environment.
    """
    rows = mission_rows(split, count=count, seed=seed, only=only)
    return Dataset.from_list([{name: row[name] for name in row if name != "tools"} for row in rows])


def reward(completions: Sequence[PolicyReply], **columns: Any) -> list[float]:  # noqa: ANN401 - columns of any type
    """The reward of each completion: 1 if and only if its program or its mission passes.

    Args:
        completions: strings, or conversations, of which the last message counts.
        columns: the columns `family`, `seed`, `prompt_index` and, for prompts as text, `opening`; for
            missions, `environments`, which a trainer passes on.

    Raises:
        EngineError: programs could not be run; the trainer stops instead of learning from wrong rewards.
    """
    return [one.reward for one in _judge(completions, columns)]


def passed(completions: Sequence[PolicyReply], **columns: Any) -> list[float]:  # noqa: ANN401 - columns of any type
    """Whether each program passes: 1 or 0."""
    return [one.passed for one in _judge(completions, columns)]


def requirements(completions: Sequence[PolicyReply], **columns: Any) -> list[float]:  # noqa: ANN401 - columns of any type
    """The share of requirements that hold; some hold for a program that does nothing."""
    return [one.requirements for one in _judge(completions, columns)]


def without_errors(completions: Sequence[PolicyReply], **columns: Any) -> list[float]:  # noqa: ANN401 - columns of any type
    """The share of worlds in which each program ends without an error."""
    return [one.without_errors for one in _judge(completions, columns)]


def parses(completions: Sequence[PolicyReply], **columns: Any) -> list[float]:  # noqa: ANN401 - columns of any type
    """Whether each program is valid Python: 1 or 0."""
    return [one.parses for one in _judge(completions, columns)]


def _judge(completions: Sequence[PolicyReply], columns: dict[str, Any]) -> list[Components]:
    if (environments := columns.get("environments")) is not None:
        return [_judge_mission(*one) for one in zip(environments, completions, strict=True)]
    openings = columns.get("opening") or [""] * len(completions)
    asked = zip(columns["family"], columns["seed"], columns["prompt_index"], strict=True)
    return judge(
        [
            Rollout(family, seed, index, program_in(completion, opening))
            for completion, opening, (family, seed, index) in zip(completions, openings, asked, strict=True)
        ]
    )


def _judge_mission(environment: MissionEnvironment, completion: PolicyReply) -> Components:
    """Judge a mission. It has reached a limit if the conversation does not end with the policy's words."""
    mission, last = environment.mission, {} if isinstance(completion, str) else completion[-1]
    if last.get("role") == "assistant" and not last.get("tool_calls"):
        mission.answer(str(last.get("content") or ""))
    else:
        mission.stop()
    return mission.components
