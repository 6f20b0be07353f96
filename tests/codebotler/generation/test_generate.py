"""A rejected program is requested again: a few times, as another sample, or as a repair."""

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
    """A model that replies with its lines; the number of a sample chooses the line."""

    lines: list[str]
    asked: list[tuple[Prompt, int]] = field(default_factory=list)
    name: str = "scripted"
    settings: SamplingSettings = field(default_factory=SamplingSettings)

    async def reply(self, prompt: Prompt, *, number: int, on_text: TextListener = ignore_text) -> Reply:
        self.asked.append((prompt, number))
        if number >= len(self.lines):
            raise ModelError("the script is over", is_temporary=False)
        on_text(self.lines[number])
        return Reply(self.lines[number], self.lines[number], Usage(3, 4), 0.25, "stop")

    async def close(self) -> None: ...


def find_bad_words(program: str) -> list[str]:
    return [f"line 1 says {program}"] if "bad" in program else []


def generate(model: Scripted, hear: Callable[[Attempt], None] = lambda _: None, **how: object) -> Generation:
    return asyncio.run(write_program(model, PROMPT, find_bad_words, on_attempt=hear, **how))  # type: ignore[arg-type] # how


def test_accepted_program_is_requested_once() -> None:
    model = Scripted(["good", "better"])
    assert generate(model, retries=5).program == "good"
    assert model.asked == [(PROMPT, 0)]


def test_rejected_program_is_requested_again_as_another_sample() -> None:
    model = Scripted(["bad 0", "bad 1", "good"])
    generation = generate(model, retries=2)
    assert generation.program == "good"
    assert generation.problems == ()
    assert [attempt.problems for attempt in generation.attempts] == [
        ("line 1 says bad 0",),
        ("line 1 says bad 1",),
        (),
    ]
    assert model.asked == [(PROMPT, 0), (PROMPT, 1), (PROMPT, 2)]


@pytest.mark.parametrize("retries", [0, 1, 3])
def test_no_more_requests_than_allowed(retries: int) -> None:
    model = Scripted([f"bad {n}" for n in range(9)])
    rejected = generate(model, retries=retries)
    assert [number for _, number in model.asked] == list(range(1 + retries))
    assert rejected.program == f"bad {retries}"
    assert rejected.problems == (f"line 1 says bad {retries}",)


def test_a_repair_carries_the_last_program_and_its_problems() -> None:
    model = Scripted(["bad 0", "bad 1", "good"])
    generate(model, retries=2, repair=True)
    (first, _), (second, _), (third, _) = model.asked
    assert first == PROMPT
    assert second == PROMPT.after("bad 0", ["line 1 says bad 0"])
    assert third == PROMPT.after("bad 1", ["line 1 says bad 1"])
    assert "line 1 says bad 1" in third.messages[-1].text
    assert "bad 0" not in third.text


def test_without_a_check_the_first_program_is_taken() -> None:
    generation = asyncio.run(write_program(Scripted(["bad"]), PROMPT, retries=3))
    assert len(generation.attempts) == 1


def test_attempts_are_reported_at_once_even_if_a_later_one_fails() -> None:
    attempts: list[Attempt] = []
    with pytest.raises(ModelError, match="the script is over"):
        generate(Scripted(["bad 0", "bad 1"]), attempts.append, retries=5)
    assert [attempt.reply.program for attempt in attempts] == ["bad 0", "bad 1"]
    assert attempts[0].problems == ("line 1 says bad 0",)
