"""Each candidate for a prompt is another sample of the model, and none is checked."""

import asyncio

import pytest

from codebotler.generation.generate import CONCURRENT_REQUESTS, gather_candidates
from codebotler.models.base import ModelError, Reply
from codebotler.prompts import prompt_for
from scripted_model import Scripted

PROMPT = prompt_for("Say hello.")


def test_each_candidate_is_another_sample() -> None:
    model = Scripted()
    attempts = asyncio.run(gather_candidates(model, PROMPT, 6))
    assert model.asked == [("Say hello.", number) for number in range(6)]
    assert ["say" in one.reply.program and str(one.number) in one.reply.program for one in attempts] == [
        True
    ] * 6
    assert not any(one.problems for one in attempts)


def test_requests_run_at_the_same_time_and_the_model_is_closed() -> None:
    model = Scripted(seconds=0.001)
    asyncio.run(gather_candidates(model, PROMPT, 6))
    assert (model.most, model.closed) == (CONCURRENT_REQUESTS, True)


def test_the_model_is_closed_after_an_error() -> None:
    model = Scripted(fails=lambda _: ModelError("no quota", is_temporary=False))
    with pytest.raises(ModelError, match="no quota"):
        asyncio.run(gather_candidates(model, PROMPT, 2))
    assert model.closed


def test_a_reply_without_a_program_is_described() -> None:
    class Refusing(Scripted):
        async def reply(self, *given: object, **named: object) -> Reply:
            found = await super().reply(*given, **named)  # type: ignore[arg-type] # passed on
            return Reply("No.", "", found.usage, None, "stop", no_program="refusal")

    (attempt,) = asyncio.run(gather_candidates(Refusing(), PROMPT, 1))
    assert attempt.programless is not None
    assert attempt.problems == (attempt.programless.sentence,)
