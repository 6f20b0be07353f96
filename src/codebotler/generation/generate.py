"""From an instruction to a program: ask a model, check what it wrote, ask again if that has problems."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from typing import Any, TypeAlias

from codebotler.checking.check import check
from codebotler.core.errors import UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.words import counted
from codebotler.generation.no_program import ProgramlessReply, programless
from codebotler.models.base import Heard, Model, Reply, unheard
from codebotler.models.open import open_model
from codebotler.models.rate_limit import RateLimited
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt, prompt_for
from codebotler.simulator.house_rule import Rule
from codebotler.simulator.pool import WorkerPool
from codebotler.simulator.sampled_robot import RoomMap

Checker: TypeAlias = Callable[[str], Sequence[str]]
"""The problems of a program, each in a sentence; none if it is accepted."""


@dataclass(frozen=True)
class Attempt:
    """One reply of a model and the problems found in it."""

    number: int  # of the sample, from 0
    prompt: Prompt = field(repr=False)  # for a repair, with the previous program and its problems
    reply: Reply = field(repr=False)
    problems: tuple[str, ...]  # one sentence each; empty if it was accepted, or not checked
    programless: ProgramlessReply | None = None  # what there is to say where the reply holds no program

    def data(self, model: str) -> dict[str, Any]:
        """The attempt as a row of JSON."""
        return {
            "instruction": self.prompt.instruction,
            "model": model,
            "number": self.number,
            "prompt": [asdict(message) for message in self.prompt.messages],
            **self.reply.data(),
            "problems": list(self.problems),
        }


@dataclass(frozen=True)
class Generation:
    """All attempts at a program, in order; the last one is the result.

    Args:
        attempts: at least one.
    """

    attempts: tuple[Attempt, ...]

    def __repr__(self) -> str:
        attempts, problems = counted(len(self.attempts), "attempt"), counted(len(self.problems), "problem")
        return f"Generation({attempts}, {problems})"

    @property
    def program(self) -> str:
        """The program of the last attempt; empty if its reply holds none."""
        return "" if self.programless else self.attempts[-1].reply.program

    @property
    def programless(self) -> ProgramlessReply | None:
        """The description of the last reply, if it holds no program."""
        return self.attempts[-1].programless

    @property
    def problems(self) -> tuple[str, ...]:
        """The problems of that program, or why there is none."""
        return self.attempts[-1].problems


def ignore(_attempt: Attempt) -> None:
    """Do nothing with an attempt."""


async def write_program(
    model: Model,
    prompt: Prompt,
    problems_of: Checker | None = None,
    *,
    retries: int = 0,
    repair: bool = False,
    heard: Heard = unheard,
    tried: Callable[[Attempt], None] = ignore,
) -> Generation:
    """Ask a model until the check accepts a program (rejection sampling; paper, section V); closes the model.

    Each further request is another sample; as a repair, it holds the rejected program and its problems, or
    why the reply holds none.
    """
    attempts: list[Attempt] = []
    limited, request = RateLimited(model, concurrency=1), prompt
    try:
        for number in range(retries + 1):
            reply = await limited.reply(request, number=number, heard=heard)
            attempts.append(await _attempt(number, request, reply, model.settings, problems_of))
            tried(attempts[-1])
            if not attempts[-1].problems:
                break
            if repair:
                request = _repair(prompt, attempts[-1])
    finally:
        await model.close()
    return Generation(tuple(attempts))


async def _attempt(
    number: int, prompt: Prompt, reply: Reply, settings: SamplingSettings, problems_of: Checker | None
) -> Attempt:
    """A reply and its problems; one without a program has no other problem."""
    if (none := programless(reply, settings)) is not None:
        return Attempt(number, prompt, reply, (none.sentence,), none)
    found = () if problems_of is None else await asyncio.to_thread(problems_of, reply.program)
    return Attempt(number, prompt, reply, tuple(found))


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
    tried: Callable[[Attempt], None] = ignore,
) -> Generation:
    """Ask a model until a program passes the check in sampled worlds; also inside of an event loop."""
    with WorkerPool(1) as pool:

        def problems_of(program: str) -> list[str]:
            found = check(
                program, rooms=rooms, room_map=room_map, pool=pool, house_rules=house_rules, skills=skills
            )
            return [problem.sentence for problem in found.problems]

        def result() -> Generation:
            return asyncio.run(
                write_program(model, prompt, problems_of, retries=retries, repair=repair, tried=tried)
            )

        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return result()
        with ThreadPoolExecutor(1) as beside:  # in a notebook
            return beside.submit(result).result()


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
    """Have a model write a program, check it in sampled worlds, and wait for the result.

    A program with problems is returned all the same, with them: its last attempt counts.

    Args:
        instruction: what the robot is to do, in plain words.
        model: the model's name, such as `recorded` or `openai-chat:gpt-5.1`.
        rooms: the names of all rooms, for the model and for the check; without them, the rooms are those that
            the program goes to.
        retries: how many times to ask again for a program with problems, at least 0; by default once with
            `repair`, else never.
        repair: whether to ask again with the program and its problems in the request.
        settings: how the model is asked, such as its temperature and its server; the defaults if None.
        skills: what the robot can do; `skills_from` reads further ones from a file.

    Raises:
        UserError: there is no such model, or an argument is out of its range.
        ModelError: a reply did not arrive, or not all of it.
        EngineError: no isolated process could be started.
    """
    tries = int(repair) if retries is None else retries
    if tries < 0:
        raise UserError(f"the number of retries is {tries}, but must be at least 0")
    prompt = prompt_for(instruction, rooms=rooms or (), skills=skills)
    asked = open_model(model, settings or SamplingSettings())
    return write_checked_program(asked, prompt, rooms=rooms, retries=tries, repair=repair, skills=skills)
