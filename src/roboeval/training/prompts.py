"""Generates prompts for training as rows of a data set, and extracts programs from a policy's completions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, TypeAlias

from codebotler.core.errors import UserError, expect_list
from codebotler.prompts.extract import program_of
from codebotler.prompts.rendering import prompt_for
from roboeval.suites.families.suite import first_seed
from roboeval.suites.families.tasks import family_file, family_names, trained_prompts, trained_task

PromptForm: TypeAlias = Literal["chat", "text"]
PolicyReply: TypeAlias = str | Sequence[Mapping[str, Any]]
"""The output of a policy: a string, or the messages of a conversation."""


def load_prompts(
    split: str = "train",
    *,
    count: int = 1_000,
    seed: int = 0,
    only: Sequence[str] = (),
    form: PromptForm = "chat",
    progress: Callable[[int], object] | None = None,
) -> list[dict[str, Any]]:
    """Generate prompts that ask for programs. Equal arguments give equal prompts.

    Args:
        split: `train`, `validation` or `test`, which share no task.
        count: the number of prompts.
        seed: the random seed, from 0. Each seed gives entirely different tasks.
        only: names or `.yaml` files of families; by default all families that ship with RoboEval.
        form: `chat` for messages, or `text` for a single text that a base model continues.
        progress: a function that is called with the number of prompts so far.

    Returns:
        Rows with `prompt` (messages with `role` and `content`, or a string), with `family`, `seed` and
        `prompt_index`, which identify the task, and with `opening`, the first line of the program if the
        prompt ends with it.

    Raises:
        UserError: the split or a family does not exist, or the count or seed is out of range.
    """
    first = first_seed(split, seed, count, "prompt")
    expect_list(only, "the families")
    for name in only:
        family_file(name)
    names = tuple(only) or family_names()
    rows: list[dict[str, Any]] = []
    for number in range(first, first + count):
        if len(rows) < len(names):  # validate the file of each family once
            trained_task(names[number % len(names)], number)
        rows.append(_row(names, number, form))
        if progress is not None:
            progress(len(rows))
    return rows


def _row(families: Sequence[str], seed: int, form: PromptForm) -> dict[str, Any]:
    """Return the row for a seed. From seed to seed, families and their prompts take turns."""
    turn, number = divmod(seed, len(families))
    family = families[number]
    prompts = trained_prompts(family, seed)
    index = turn % len(prompts)
    asked = prompt_for(prompts[index])
    chat = [{"role": message.role, "content": message.text} for message in asked.messages]
    return {
        "prompt": chat if form == "chat" else asked.text,
        "family": family,
        "seed": seed,
        "prompt_index": index,
        "opening": "" if form == "chat" else asked.opening,
    }


def program_in(completion: PolicyReply, opening: str = "") -> str:
    """Extract the program from a policy's completion, such as the code block in a chat message.

    Args:
        completion: a string, or messages that end with the policy's message.
        opening: the `opening` of the prompt's row. If it is not empty, the completion continues this line.

    Raises:
        UserError: there is no message, or the last one has no content.
    """
    text = completion if isinstance(completion, str) else _last_text(completion)
    if not opening:
        return program_of(text).source
    return program_of(prompt_for("go on").program_from(text), continues=True).source


def _last_text(messages: Sequence[Mapping[str, Any]]) -> str:
    """Return the text of the last message, whose content may be a list of parts."""
    if not messages or "content" not in messages[-1]:
        raise UserError("a completion has no message with content; pass a string or a list of messages")
    content = messages[-1]["content"]
    if isinstance(content, str) or content is None:
        return content or ""
    return "".join(part.get("text") or "" for part in content)
