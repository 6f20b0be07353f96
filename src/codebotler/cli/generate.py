"""What `codebotler generate` does: asks a model, checks, asks again, and says what is going on."""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from codebotler.checking.check import check
from codebotler.core.replacing import expect_replaceable
from codebotler.core.terminal import busy, note, print_source, visible
from codebotler.core.world import World
from codebotler.generation.generate import Attempt, Generation, generate, untold
from codebotler.models.base import Model, SamplingSettings
from codebotler.models.open import kind_of, open_model
from codebotler.models.rate_limit import RateLimited
from codebotler.prompts import Prompt
from codebotler.simulator.engine import WorkerPool
from codebotler.simulator.sampled_robot import RoomMap


def write(
    prompt: Prompt,
    model: str,
    settings: SamplingSettings,
    *,
    world: World | None,
    retries: int,
    repair: bool,
    record: Path | None,
) -> bool:
    """Have a model write a program, and print that; whether a check finds nothing wrong with it.

    Args:
        prompt: what is asked.
        model: the name of who is asked.
        settings: how it is asked.
        world: where the program is to run; without it, the rooms are those that the program goes to.
        retries: how many times a rejected program is asked for again, at least 0.
        repair: whether to ask again with the program and its problems.
        record: the file that gets a line for every attempt, if one is named.

    Raises:
        UserError: there is no such model.
        ModelError: no whole reply came.
        EngineError: no isolated process could be started.
        OSError: an attempt could not be recorded; the program is printed all the same.
    """
    with ExitStack() as recording:
        with busy(f"asking {model}"):
            asked = open_model(model, settings)
            note_down = recording.enter_context(recorder(record, asked.name))
            plan = None if world is None else RoomMap.of(world)
            made = generated(asked, prompt, plan=plan, retries=retries, repair=repair, note_down=note_down)
        print_source(made.program)
    return not made.problems


def generated(
    model: Model,
    prompt: Prompt,
    *,
    plan: RoomMap | None = None,
    retries: int = 0,
    repair: bool = False,
    note_down: Callable[[Attempt], None] = untold,
) -> Generation:
    """Have a model write a program, and say beside the results what is wrong with each attempt.

    Args:
        model: who is asked; it is closed at the end.
        prompt: what is asked.
        plan: the rooms; without it, they are those that the program goes to.
        retries: how many times a rejected program is asked for again, at least 0.
        repair: whether to ask again with the program and its problems.
        note_down: told each attempt as it ends.

    Raises:
        ModelError: no whole reply came.
        EngineError: no isolated process could be started.
    """
    with WorkerPool(1) as pool:

        def problems(program: str) -> list[str]:
            found = check(program, pool=pool, plan=plan)
            return [problem.sentence for problem in found.problems]

        def tried(attempt: Attempt) -> None:
            note_down(attempt)
            _tell(attempt, retries + 1)

        async def asked() -> Generation:
            try:
                paced = RateLimited(model, concurrency=1)
                return await generate(paced, prompt, problems, retries=retries, repair=repair, tried=tried)
            finally:
                await model.close()

        return asyncio.run(asked())


@contextmanager
def recorder(path: Path | None, model: str) -> Iterator[Callable[[Attempt], None]]:
    """What adds attempts to a file, each when it has ended; nothing is added if no file is named.

    Args:
        path: the file.
        model: the name of who is asked.

    Raises:
        UserError: the file holds something else.
        OSError: at the end, if an attempt could not be added; after it, none is.
    """
    if path is None:
        yield untold
        return
    expect_replaceable(path, b"{")
    failed: OSError | None = None
    with path.open("ab", buffering=0) as file:

        def add(attempt: Attempt) -> None:
            nonlocal failed
            if failed is not None:
                return
            start = os.fstat(file.fileno()).st_size
            text = json.dumps(attempt.data(model), ensure_ascii=False) + "\n"
            line = memoryview(text.encode(errors="backslashreplace"))
            try:
                while line:
                    line = line[file.write(line) :]
            except OSError as error:
                failed = OSError(error.errno, error.strerror, str(path))
                with suppress(OSError):  # a device or a pipe has nothing to take back
                    file.truncate(start)

        yield add
    if failed is not None:
        raise failed


def _tell(attempt: Attempt, most: int) -> None:
    which = f"attempt {attempt.number + 1} of {most}" if most > 1 else "the program"
    if attempt.problems:
        note(f"{which} has {'problems' if len(attempt.problems) > 1 else 'a problem'}:")
        for problem in attempt.problems:
            note(f"  {visible(problem)}")
    elif attempt.number:
        note(f"{which} is accepted")


def show(prompt: Prompt, model: str) -> None:
    """Print what a model is asked: the messages of a chat, or the one text that base models go on from.

    Args:
        prompt: what is asked.
        model: the name of the model, which tells in which way it is asked.

    Raises:
        UserError: there is no such kind of model.
    """
    kind = kind_of(model)
    if kind == "completions":
        print_source(prompt.text)
    else:
        print_source("\n\n".join(f"--- {message.role}\n{message.text}" for message in prompt.messages))
    if kind == "hf":
        note(
            f"these are the messages that {model} gets if its tokenizer has a chat template; "
            "without one it gets the text that --model completions:NAME shows"
        )
