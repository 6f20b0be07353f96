"""`ModelAuthor`: requests programs for one mission from a language model."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from codebotler.generation.generate import Attempt, gather_candidates
from codebotler.missions.display.view import SessionView
from codebotler.models.base import Model, TextListener, ignore_text
from codebotler.models.open import open_model
from codebotler.prompts import Prompt, prompt_for
from codebotler.robots.base import Robot


class ModelAuthor:
    """Requests programs for a mission from the model `name`. Any thread can cancel the requests."""

    def __init__(self, open_model: Callable[[str], Model], name: str) -> None:
        self._open_model, self._name = open_model, name
        self._model: Model | None = None  # the model of the latest request
        self.max_tokens: int | None = None  # the token limit chosen by a person; None for the default
        self._request: tuple[asyncio.AbstractEventLoop, asyncio.Task[Any]] | None = None
        self._is_cancelled = False

    def write(self, prompt: Prompt, count: int, on_text: TextListener) -> tuple[str, Sequence[Attempt]]:
        """Request programs. Return the model's name and replies. Raise `asyncio.CancelledError` if cancelled.

        Args:
            prompt: the prompt to send.
            count: how many replies to request.
            on_text: called with each piece of the reply as it arrives, but only if `count` is 1.
        """
        model = self._open()
        listener = on_text if count == 1 else ignore_text
        writing = gather_candidates(model, prompt, count, on_text=listener)
        return model.name, asyncio.run(self._await(writing))

    def _open(self) -> Model:
        if self.max_tokens is None or self._model is None:
            self._model = self._open_model(self._name)
        if self.max_tokens is not None:
            settings = replace(self._model.settings, max_tokens=self.max_tokens)
            self._model = open_model(self._model.name, settings)
        return self._model

    def cancel(self) -> None:
        """Cancel the current request and any later ones."""
        self._is_cancelled, request = True, self._request
        if request is not None:
            with suppress(RuntimeError):  # the event loop has already ended
                request[0].call_soon_threadsafe(request[1].cancel)

    async def _await(self, writing: Coroutine[None, None, list[Attempt]]) -> list[Attempt]:
        task = asyncio.create_task(writing)
        self._request = (asyncio.get_running_loop(), task)
        try:
            if self._is_cancelled:
                task.cancel()
            return await task
        finally:
            self._request = None


def prompt_of(view: SessionView, robot: Robot, *, repair: bool) -> Prompt:
    """Return the prompt that asks for a mission's program. `repair` adds the faults of the last reply."""
    past, room_map = view.past, view.room_map
    prompt = prompt_for(
        view.instruction,
        rooms=() if room_map is None else room_map.described,
        rules=[rule.says for rule in view.rules_in_force],
        skills=robot.skills.without(robot.missing),
    )
    if past is not None:
        place = past.place if room_map is None else room_map.start
        position, last = past.position_text(place), (past.done or [""])[-1]
        prompt = prompt.to_continue(past.program, past.steps, past.why, position, last)
    if repair and view.problems:
        return prompt.after(view.program, view.problems)
    if repair and view.programless is not None:
        return prompt.after_no_program(view.programless.sentence)
    return prompt
