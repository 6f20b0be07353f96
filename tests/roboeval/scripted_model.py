"""A model for tests of its callers: it takes its time, fails on demand, and keeps a log."""

from __future__ import annotations

import asyncio
import json
import os
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from codebotler.models.base import ModelError, Reply, TextListener, Usage, ignore_text
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt

PROGRAM = 'def task_program():\n    say("{number}")\n'


@dataclass
class Scripted:
    """A model that answers any instruction.

    Args:
        seconds: how long a reply takes on average.
        fails: returns the error of a request by its number from 0, or none.
        log: a file that gets a line as each request comes in and as each reply leaves.
        text: the program, with `{number}` for the sample's number.
    """

    seconds: float = 0.0
    fails: Callable[[int], ModelError | None] = lambda _: None
    log: Path | None = None
    text: str = PROGRAM
    name: str = "scripted:one"
    settings: SamplingSettings = field(default_factory=SamplingSettings)
    asked: list[tuple[str, int]] = field(default_factory=list)
    under_way: int = 0
    most: int = 0
    closed: bool = False

    async def reply(self, prompt: Prompt, *, number: int, on_text: TextListener = ignore_text) -> Reply:
        self.asked.append((prompt.instruction, number))
        self.under_way += 1
        self.most = max(self.most, self.under_way)
        self._note("asked", prompt, number)
        try:
            if error := self.fails(len(self.asked) - 1):
                raise error
            if self.seconds:
                await asyncio.sleep(random.uniform(0, 2 * self.seconds))
            text = self.text.format(number=number)
            on_text(text)
            self._note("answered", prompt, number)
            return Reply(text, text, Usage(100, 10), self.seconds, "stop")
        finally:
            self.under_way -= 1

    async def close(self) -> None:
        self.closed = True

    def _note(self, what: str, prompt: Prompt, number: int) -> None:
        if self.log is not None:
            with self.log.open("ab", buffering=0) as file:
                file.write(f"{json.dumps([what, prompt.instruction, number, os.getpid()])}\n".encode())
