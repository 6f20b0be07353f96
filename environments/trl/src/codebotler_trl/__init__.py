"""Robot programs as rewards for TRL: a data set of prompts, and reward functions for its trainers.

`reward` is what a policy is trained on. Each further function returns one part of it, to be logged beside it
with the weight 0. What one of them has judged costs the others nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from datasets import Dataset  # type: ignore[import-untyped]  # it has no types

from roboeval.training.prompts import Completion, Form, program_in
from roboeval.training.prompts import load_prompts as rows_of
from roboeval.training.rollouts import Components, Rollout, judge

__all__ = ["load_prompts", "parses", "passed", "requirements", "reward", "without_errors"]


def load_prompts(
    split: str = "train", *, count: int = 1_000, seed: int = 0, only: Sequence[str] = (), form: Form = "chat"
) -> Dataset:
    """A data set of prompts, as `roboeval.training.load_prompts` describes them.

    Its columns `family`, `seed`, `prompt_index` and `opening` are what the rewards need; a trainer passes
    them on unless `remove_unused_columns` is set.
    """
    return Dataset.from_list(rows_of(split, count=count, seed=seed, only=only, form=form))


def reward(completions: Sequence[Completion], **columns: Any) -> list[float]:  # noqa: ANN401 - of any column
    """The reward of each completion, from 0 to 1: 1 exactly if its program passes, 0 if it does nothing.

    Args:
        completions: texts, or conversations of which the last message counts.
        columns: of the data set: `family`, `seed`, `prompt_index` and, where prompts are texts, `opening`.

    Raises:
        EngineError: programs could not be run; a trainer stops, rather than learn from rewards that are none.
    """
    return [one.reward for one in _judged(completions, columns)]


def passed(completions: Sequence[Completion], **columns: Any) -> list[float]:  # noqa: ANN401 - the same
    """Whether each program passes: 1 or 0."""
    return [one.passed for one in _judged(completions, columns)]


def requirements(completions: Sequence[Completion], **columns: Any) -> list[float]:  # noqa: ANN401 - the same
    """The share of the requirements that hold, of which some hold if nothing is done."""
    return [one.requirements for one in _judged(completions, columns)]


def without_errors(completions: Sequence[Completion], **columns: Any) -> list[float]:  # noqa: ANN401 - the same
    """The share of the worlds in which each program ends by itself."""
    return [one.without_errors for one in _judged(completions, columns)]


def parses(completions: Sequence[Completion], **columns: Any) -> list[float]:  # noqa: ANN401 - the same
    """Whether each completion holds Python: 1 or 0."""
    return [one.parses for one in _judged(completions, columns)]


def _judged(completions: Sequence[Completion], columns: dict[str, Any]) -> list[Components]:
    openings = columns.get("opening") or [""] * len(completions)
    asked = zip(columns["family"], columns["seed"], columns["prompt_index"], strict=True)
    return judge(
        [
            Rollout(family, seed, index, program_in(completion, opening))
            for completion, opening, (family, seed, index) in zip(completions, openings, asked, strict=True)
        ]
    )
