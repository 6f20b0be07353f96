"""A reply without a program is described in a sentence, and the model is asked again."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field

import pytest

from codebotler.generation.generate import Generation, write_program
from codebotler.generation.no_program import describe_programless
from codebotler.models.base import Reply, TextListener, Usage, ignore_text, make_reply
from codebotler.models.no_program import NO_PROGRAM_KINDS, NoProgram
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt, prompt_for

PROMPT = prompt_for("Say hello.")
PROGRAM = "def task_program():\n    say('hello')\n"
PLAIN = SamplingSettings()


def reply(text: str, kind: NoProgram | None, tokens: int | None = None) -> Reply:
    return Reply(text, text, Usage(9, tokens), 0.0, "stop", no_program=kind)


@dataclass
class Scripted:
    """A model that gives its replies one after the other."""

    replies: list[Reply]
    asked: list[Prompt] = field(default_factory=list)
    name: str = "scripted"
    settings: SamplingSettings = field(default_factory=SamplingSettings)

    async def reply(self, prompt: Prompt, *, number: int, on_text: TextListener = ignore_text) -> Reply:
        self.asked.append(prompt)
        on_text(self.replies[number].text)
        return self.replies[number]

    async def close(self) -> None: ...


def generate(model: Scripted, *, retries: int, repair: bool) -> Generation:
    checked: list[str] = []

    def problems_of(program: str) -> list[str]:
        checked.append(program)
        assert program == PROGRAM, "only programs are checked"
        return []

    return asyncio.run(write_program(model, PROMPT, problems_of, retries=retries, repair=repair))


@pytest.mark.parametrize("kind", NO_PROGRAM_KINDS)
def test_every_kind_has_a_sentence_and_a_whole_program_has_none(kind: NoProgram) -> None:
    none = describe_programless(reply("what it says", kind), PLAIN)
    assert none is not None
    assert (none.kind, none.text) == (kind, "what it says")
    assert none.sentence
    assert describe_programless(reply(PROGRAM, None), PLAIN) is None


@pytest.mark.parametrize(
    ("limit", "tokens", "named", "higher"),
    [(512, 300, "512", 2048), (None, 1000, "1,000", 4000), (None, None, "cut off", 16_384)],
)
def test_a_reply_that_was_cut_off_names_its_limit_and_a_higher_one(
    limit: int | None, tokens: int | None, named: str, higher: int
) -> None:
    none = describe_programless(reply("def task", "cut-off", tokens), SamplingSettings(max_tokens=limit))
    assert none is not None
    assert named in none.sentence
    assert none.higher_limit == higher


def test_a_refusal_is_quoted_and_kept_short() -> None:
    none = describe_programless(reply("I can't help with that. " * 50, "refusal"), PLAIN)
    assert none is not None
    assert "I can't help with that." in none.sentence
    assert len(none.sentence) < 300
    assert none.higher_limit is None


@pytest.mark.parametrize("repair", [False, True])
def test_a_reply_without_a_program_is_not_checked_and_asked_for_again(*, repair: bool) -> None:
    prose = make_reply("I am afraid that I cannot do that.", Usage(), 0.0, "stop")
    model = Scripted([prose, reply(PROGRAM, None)])
    generation = generate(model, retries=1, repair=repair)
    first, last = generation.attempts
    assert first.programless is not None
    assert first.problems == (first.programless.sentence,)
    assert (generation.program, generation.problems, last.programless) == (PROGRAM, (), None)
    again = PROMPT.after_no_program(first.programless.sentence) if repair else PROMPT
    assert model.asked == [PROMPT, again]


def test_a_repair_after_no_program_adds_to_the_request_alone() -> None:
    again = PROMPT.after_no_program("The reply is empty.")
    assert again.messages[:-1] == PROMPT.messages[:-1]
    assert again.messages[-1].text.startswith(PROMPT.messages[-1].text)
    assert "The reply is empty." in again.messages[-1].text
    assert again.text == PROMPT.text, "a base model reads no advice"


def test_a_last_reply_without_a_program_leaves_none() -> None:
    generation = generate(Scripted([reply("", "empty")]), retries=0, repair=False)
    assert generation.program == ""
    assert generation.programless is not None
    assert generation.problems == (generation.programless.sentence,)
