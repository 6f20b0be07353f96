"""Ask a model for a program, check it, and ask again if it has problems."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TypeAlias

from codebotler.checking.check import check
from codebotler.core.errors import UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.text.words import counted
from codebotler.generation.no_program import ProgramlessReply, describe_programless
from codebotler.models.base import Model, Reply, TextListener, ignore_text
from codebotler.models.open import open_model
from codebotler.models.rate_limit import RateLimited
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt, prompt_for
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.pool import WorkerPool
from codebotler.simulator.worlds.room_map import RoomMap

CONCURRENT_REQUESTS = 4  # for candidates

Checker: TypeAlias = Callable[[str], Sequence[str]]
"""A function that returns the problems of a program, one sentence each; none if it accepts the program."""


@dataclass(frozen=True)
class Attempt:
    """One reply of a model, and the problems of the program in it."""

    number: int  # the number of the sample, counted from 0
    prompt: Prompt = field(repr=False)  # for a repair, with the previous program and its problems
    reply: Reply = field(repr=False)
    problems: tuple[str, ...]  # empty if the program was accepted or not checked
    programless: ProgramlessReply | None = None  # set if the reply has no program


@dataclass(frozen=True)
class Generation:
    """All attempts at a program, in order. The last one is the result."""

    attempts: tuple[Attempt, ...]  # at least one

    def __repr__(self) -> str:
        attempts, problems = counted(len(self.attempts), "attempt"), counted(len(self.problems), "problem")
        return f"Generation({attempts}, {problems})"

    @property
    def program(self) -> str:
        """The program of the last attempt, or an empty string if its reply has no program."""
        return "" if self.programless else self.attempts[-1].reply.program

    @property
    def programless(self) -> ProgramlessReply | None:
        """Why the last reply has no program, or None if it has one."""
        return self.attempts[-1].programless

    @property
    def problems(self) -> tuple[str, ...]:
        """The problems of the last program, or the reason why there is no program."""
        return self.attempts[-1].problems


def ignore_attempt(_attempt: Attempt) -> None:
    """Do nothing. This is the default for `on_attempt`."""


async def write_program(
    model: Model,
    prompt: Prompt,
    find_problems: Checker | None = None,
    *,
    retries: int = 0,
    repair: bool = False,
    on_attempt: Callable[[Attempt], None] = ignore_attempt,
) -> Generation:
    """Ask a model for a program until `find_problems` accepts one (rejection sampling; paper, section V).

    Ask again at most `retries` times; with `repair`, the request then includes the rejected program and its
    problems. Accept any program if `find_problems` is None. Close the model at the end.
    """
    attempts: list[Attempt] = []
    limited, request = RateLimited(model, concurrency=1), prompt
    try:
        for number in range(retries + 1):
            reply = await limited.reply(request, number=number)
            attempts.append(await make_attempt(number, request, reply, model.settings, find_problems))
            on_attempt(attempts[-1])
            if not attempts[-1].problems:
                break
            if repair:
                request = _repair(prompt, attempts[-1])
    finally:
        await model.close()
    return Generation(tuple(attempts))


async def make_attempt(
    number: int,
    prompt: Prompt,
    reply: Reply,
    settings: SamplingSettings,
    find_problems: Checker | None = None,
) -> Attempt:
    """Check the program in a reply, and return the attempt. If there is no program, that is its problem."""
    if (none := describe_programless(reply, settings)) is not None:
        return Attempt(number, prompt, reply, (none.sentence,), none)
    found = () if find_problems is None else await asyncio.to_thread(find_problems, reply.program)
    return Attempt(number, prompt, reply, tuple(found))


async def gather_candidates(
    model: Model, prompt: Prompt, count: int, on_text: TextListener = ignore_text
) -> list[Attempt]:
    """Ask a model for `count` programs, several at a time. Do not check them; close the model at the end.

    Raises:
        ModelError: the model sent no complete reply to one of the requests.
    """
    limited = RateLimited(model, concurrency=CONCURRENT_REQUESTS)
    try:
        requests = (limited.reply(prompt, number=number, on_text=on_text) for number in range(count))
        replies = await asyncio.gather(*requests)
    finally:
        await model.close()
    return [await make_attempt(number, prompt, reply, model.settings) for number, reply in enumerate(replies)]


def _repair(prompt: Prompt, attempt: Attempt) -> Prompt:
    if attempt.programless is not None:
        return prompt.after_no_program(attempt.programless.sentence)
    return prompt.after(attempt.reply.program, attempt.problems)


def write_checked_program(
    model: Model,
    prompt: Prompt,
    *,
    rooms: Sequence[str] | None = None,
    room_map: RoomMap | None = None,
    house_rules: tuple[Rule, ...] = (),
    skills: SkillTable = SKILLS,
    retries: int = 0,
    repair: bool = False,
    on_attempt: Callable[[Attempt], None] = ignore_attempt,
) -> Generation:
    """Ask a model up to `retries` + 1 times, until a program passes the check. Return all attempts."""
    with WorkerPool(1) as pool:

        def find_problems(program: str) -> list[str]:
            found = check(
                program, rooms=rooms, room_map=room_map, pool=pool, house_rules=house_rules, skills=skills
            )
            return [problem.sentence for problem in found.problems]

        def write() -> Generation:
            return asyncio.run(
                write_program(
                    model, prompt, find_problems, retries=retries, repair=repair, on_attempt=on_attempt
                )
            )

        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return write()
        with ThreadPoolExecutor(1) as executor:  # a notebook runs an event loop in this thread
            return executor.submit(write).result()


def generate(
    instruction: str,
    *,
    model: str = "recorded",
    rooms: Sequence[str] | None = None,
    retries: int | None = None,
    repair: bool = False,
    settings: SamplingSettings | None = None,
    skills: SkillTable = SKILLS,
) -> Generation:
    """Ask a model for a program, and check the program in sampled worlds.

    If all attempts have problems, the result contains the program and the problems of the last one.

    Args:
        instruction: the robot's task, in plain words.
        model: the model's name, such as `recorded` or `openai-chat:gpt-5.1`.
        rooms: the names of all rooms, for the model and the check; by default those that the program visits.
        retries: how many times to ask again after problems, at least 0; by default 1 with `repair`, else 0.
        repair: whether to ask again with the program and its problems in the request.
        settings: the model's settings, such as its temperature and server; None for the defaults.
        skills: the robot's skills; `skills_from` reads custom skills from files.

    Raises:
        UserError: the model does not exist, or an argument is out of range.
        ModelError: the model sent no complete reply.
        EngineError: no isolated process could be started.
    """
    tries = int(repair) if retries is None else retries
    if tries < 0:
        raise UserError(f"the number of retries is {tries}; use a number of at least 0")
    prompt = prompt_for(instruction, rooms=rooms or (), skills=skills)
    opened = open_model(model, settings or SamplingSettings())
    return write_checked_program(opened, prompt, rooms=rooms, retries=tries, repair=repair, skills=skills)
