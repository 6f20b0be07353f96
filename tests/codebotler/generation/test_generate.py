"""Asking again: as often as allowed, as another sample, and with the problems for a repair."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from codebotler.generation.generate import Attempt, Generation, write_program
from codebotler.models.base import ModelError, Reply, TextListener, Usage, ignore_text
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt, prompt_for

PROMPT = prompt_for("Say hello.")


@dataclass
class Scripted:
    """A model that says its lines; the number of a sample chooses the line."""

    lines: list[str]
    asked: list[tuple[Prompt, int]] = field(default_factory=list)
    name: str = "scripted"
    settings: SamplingSettings = field(default_factory=SamplingSettings)

    async def reply(self, prompt: Prompt, *, number: int, on_text: TextListener = ignore_text) -> Reply:
        self.asked.append((prompt, number))
        if number >= len(self.lines):
            raise ModelError("the script is over", may_pass=False)
        on_text(self.lines[number])
        return Reply(self.lines[number], self.lines[number], Usage(3, 4), 0.25, "stop")

    async def close(self) -> None: ...


def no_bad_word(program: str) -> list[str]:
    return [f"line 1 says {program}"] if "bad" in program else []


def made(model: Scripted, tried: Callable[[Attempt], None] = lambda _: None, **how: object) -> Generation:
    return asyncio.run(write_program(model, PROMPT, no_bad_word, on_attempt=tried, **how))  # type: ignore[arg-type] # how


def test_a_program_that_is_accepted_is_asked_for_once() -> None:
    model = Scripted(["good", "better"])
    assert made(model, retries=5).program == "good"
    assert model.asked == [(PROMPT, 0)]


def test_a_rejected_one_is_asked_for_again_as_another_sample_of_the_same_prompt() -> None:
    model = Scripted(["bad 0", "bad 1", "good"])
    made_of_three = made(model, retries=2)
    assert made_of_three.program == "good"
    assert made_of_three.problems == ()
    assert [attempt.problems for attempt in made_of_three.attempts] == [
        ("line 1 says bad 0",),
        ("line 1 says bad 1",),
        (),
    ]
    assert model.asked == [(PROMPT, 0), (PROMPT, 1), (PROMPT, 2)]


@pytest.mark.parametrize("retries", [0, 1, 3])
def test_no_more_requests_than_allowed(retries: int) -> None:
    model = Scripted([f"bad {n}" for n in range(9)])
    rejected = made(model, retries=retries)
    assert [number for _, number in model.asked] == list(range(1 + retries))
    assert rejected.program == f"bad {retries}"
    assert rejected.problems == (f"line 1 says bad {retries}",)


def test_a_repair_carries_the_last_program_and_its_problems() -> None:
    model = Scripted(["bad 0", "bad 1", "good"])
    made(model, retries=2, repair=True)
    (first, _), (second, _), (third, _) = model.asked
    assert first == PROMPT
    assert second == PROMPT.after("bad 0", ["line 1 says bad 0"])
    assert third == PROMPT.after("bad 1", ["line 1 says bad 1"])
    assert "line 1 says bad 1" in third.messages[-1].text
    assert "bad 0" not in third.text


def test_without_a_check_the_first_program_is_taken() -> None:
    generation = asyncio.run(write_program(Scripted(["bad"]), PROMPT, retries=3))
    assert len(generation.attempts) == 1


def test_attempts_are_told_as_they_end_also_where_a_later_one_fails() -> None:
    told: list[Attempt] = []
    with pytest.raises(ModelError, match="the script is over"):
        made(Scripted(["bad 0", "bad 1"]), told.append, retries=5)
    assert [attempt.reply.program for attempt in told] == ["bad 0", "bad 1"]
    assert told[0].problems == ("line 1 says bad 0",)
