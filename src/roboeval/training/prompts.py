"""Prompts to train on: rows of a data set, and the program in what a policy writes for one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, TypeAlias

from codebotler.core.errors import UserError, expect_list
from codebotler.prompts.extract import program_of
from codebotler.prompts.rendering import prompt_for
from roboeval.suites.families.suite import first_seed
from roboeval.suites.families.tasks import family_file, family_names, trained_prompts, trained_task

Form: TypeAlias = Literal["chat", "text"]
Completion: TypeAlias = str | Sequence[Mapping[str, Any]]
"""What a policy wrote: a text, or the messages of a conversation."""


def load_prompts(
    split: str = "train",
    *,
    count: int = 1_000,
    seed: int = 0,
    only: Sequence[str] = (),
    form: Form = "chat",
    progress: Callable[[int], object] | None = None,
) -> list[dict[str, Any]]:
    """Prompts for programs, the same on every machine; as many as are wanted.

    Args:
        split: `train`, `validation` or `test`, which share no task.
        count: how many prompts.
        seed: for others: with the next number, all tasks are new.
        only: the families to draw from, also files of your own; all that are here by default.
        form: `chat` for messages, `text` for one text that base models go on from.
        progress: called with the number of prompts that are made, each time that it has grown.

    Returns:
        rows with `prompt` (messages with `role` and `content`, or a text), `family`, `seed` and
        `prompt_index`, which say what it asks for, and `opening`: the first line of the program if the
        prompt ends with it, else nothing.

    Raises:
        UserError: there is no such split or family, or the count or the seed is out of range.
    """
    first = first_seed(split, seed, count, "prompt")
    expect_list(only, "the families")
    for name in only:
        family_file(name)
    names = tuple(only) or family_names()
    rows: list[dict[str, Any]] = []
    for number in range(first, first + count):
        if len(rows) < len(names):  # once for each family, whose file may be wrong
            trained_task(names[number % len(names)], number)
        rows.append(_row(names, number, form))
        if progress is not None:
            progress(len(rows))
    return rows


def _row(families: Sequence[str], seed: int, form: Form) -> dict[str, Any]:
    """The row of a seed: in turn of each family, and of each of its phrasings."""
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


def program_in(completion: Completion, opening: str = "") -> str:
    """The program in what a policy wrote.

    Args:
        completion: a text, or messages, of which the last is the policy's.
        opening: what the prompt ended with, if a text was to go on from it.

    Raises:
        UserError: there is no message, or one without content.
    """
    text = completion if isinstance(completion, str) else _said(completion)
    if not opening:
        return program_of(text).source
    return program_of(prompt_for("go on").program_from(text), continues=True).source


def _said(messages: Sequence[Mapping[str, Any]]) -> str:
    """The text of the last message, which may come in parts."""
    if not messages or "content" not in messages[-1]:
        raise UserError("a completion has no message with content")
    content = messages[-1]["content"]
    if isinstance(content, str) or content is None:
        return content or ""
    return "".join(part.get("text") or "" for part in content)
