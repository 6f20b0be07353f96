import ast
import asyncio
import pickle
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.errors import UserError
from codebotler.core.trace import Status
from codebotler.core.world import Room, World
from codebotler.models import base
from codebotler.models.open import expect_server, open_model
from codebotler.models.recorded import RECORDED_NAMES, UnknownInstructionError, _words, open_recorded
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import prompt_for
from codebotler.simulator.engine import run


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", ["recorded", "recorded:", "recorded:careful", "careful"])
def test_recorded_means_the_careful_model(name: str) -> None:
    assert open_recorded(name).name == "recorded:careful"


def test_unknown_recorded_model_is_refused() -> None:
    with pytest.raises(UserError, match=r'"recorded:lazy".* recorded:careful or recorded:hasty'):
        open_recorded("recorded:lazy")


def test_replies_repeat_in_a_cycle() -> None:
    model = open_recorded("recorded:hasty")
    for instruction, replies in model.replies.items():
        assert [model.solution(instruction, i) for i in range(2 * len(replies))] == [*replies, *replies]


def test_new_instruction_has_no_recording() -> None:
    with pytest.raises(KeyError):
        open_recorded("recorded").solution("Fetch me a coffee", 0)


def test_both_models_know_the_same_instructions() -> None:
    careful, hasty = (open_recorded(name).replies for name in RECORDED_NAMES)
    assert set(careful) == set(hasty)
    assert len({*map(_words, careful)}) == len(careful) == 129


@pytest.mark.parametrize("name", RECORDED_NAMES)
def test_every_recorded_program_defines_its_task_or_is_marked_as_broken(name: str) -> None:
    for replies in open_recorded(name).replies.values():
        assert replies
        for reply in replies:
            assert reply.about
            assert "def task_program" in reply.program
            try:
                ast.parse(reply.program)
            except SyntaxError as error:
                assert reply.fails == type(error).__name__  # noqa: PT017 - most parse
            else:
                assert reply.fails != "SyntaxError"


def test_careful_model_is_right_more_often_than_the_hasty_one() -> None:
    def share(name: str) -> float:
        marks = [reply.fails is None for replies in open_recorded(name).replies.values() for reply in replies]
        return sum(marks) / len(marks)

    assert 1 > share("careful") > share("hasty") > 0


def reply_to(instruction: str, number: int = 0, model: str = "recorded") -> base.Reply:
    return asyncio.run(open_model(model, SamplingSettings()).reply(prompt_for(instruction), number=number))


def test_recorded_model_is_asked_like_any_other() -> None:
    recorded = open_recorded("recorded:hasty")
    instruction, replies = max(recorded.replies.items(), key=lambda item: len(item[1]))
    heard: list[str] = []
    model = open_model("recorded:hasty", SamplingSettings())
    assert model.name == "recorded:hasty"
    reply = asyncio.run(model.reply(prompt_for(instruction), number=1, on_text=heard.append))
    asyncio.run(model.close())
    program = replies[1].program
    assert reply == base.Reply(program, program, base.Usage(None, None), 0.0, "stop")
    assert heard == [program]
    assert reply_to(instruction, len(replies), "recorded:hasty").program == replies[0].program


def test_spaces_capitals_and_the_final_full_stop_do_not_make_another_instruction() -> None:
    instruction = next(one for one in open_recorded("recorded").replies if one.endswith("."))
    for other in (f"\n {instruction.upper().replace(' ', '  ')}\n", instruction[:-1], f"{instruction}\n.."):
        assert reply_to(other) == reply_to(instruction)


# --- the first instruction in the README

CHECK_THE_PRINTER_ROOMS = "Check every printer room for a stapler, and come back and tell me which have none"
PRINTER_ROOMS = ("printer room 1", "printer room 2", "printer room 3")


def run_recorded(model: str, without_stapler: Iterable[str]) -> tuple[str, str]:
    """Run a recorded program; return its only statement, and where it made it."""
    rooms = (Room(room, () if room in without_stapler else ("stapler",)) for room in ("lab", *PRINTER_ROOMS))
    world = World((Room("hall"), *rooms), "hall")
    (outcome,) = run([(reply_to(CHECK_THE_PRINTER_ROOMS, model=model).program, world)], workers=1)
    assert outcome.status is Status.FINISHED
    assert {event.text for event in outcome.trace if event.kind == "goto"} == {"hall", *PRINTER_ROOMS}
    (said,) = (event for event in outcome.trace if event.kind == "say")
    assert outcome.trace[-1] == said
    return said.text, said.place


@pytest.mark.parametrize("without_stapler", [(), PRINTER_ROOMS[:1], PRINTER_ROOMS[::2], PRINTER_ROOMS])
def test_the_readmes_first_instruction_is_carried_out_by_the_careful_model(
    without_stapler: tuple[str, ...],
) -> None:
    said, place = run_recorded("recorded", without_stapler)
    assert place == "hall"
    assert tuple(room for room in PRINTER_ROOMS if room in said) == without_stapler


def test_the_readmes_first_instruction_is_one_that_the_hasty_model_gets_wrong() -> None:
    said, _ = run_recorded("recorded:hasty", PRINTER_ROOMS)
    assert [room for room in PRINTER_ROOMS if room in said] == ["printer room 3"]


def test_the_readmes_first_instruction_is_in_the_readme() -> None:
    text = (Path(__file__).parents[3] / "README.md").read_text(encoding="utf-8")
    first, rest = text.split("\n## ", 1)
    assert f'"{CHECK_THE_PRINTER_ROOMS}"' in " ".join(first.split())
    assert f'codebotler run "{CHECK_THE_PRINTER_ROOMS}"' in rest


def test_error_for_an_unknown_instruction_names_the_closest() -> None:
    with pytest.raises(UnknownInstructionError) as caught:
        reply_to("Fetch me a coffee from the kitchen")
    sentence = caught.value.sentence
    assert "recorded:careful" in sentence
    assert '"Fetch me a coffee from the kitchen"' in sentence
    assert '"Go to the lobby and ask the visitor there whether they want water' in sentence
    assert len(caught.value.closest) == 3
    assert not caught.value.is_temporary
    assert pickle.loads(pickle.dumps(caught.value)).closest == caught.value.closest
    assert "\n" not in sentence


@pytest.mark.parametrize("name", ["", "gpt-5.1", ":a", "hf:", "completions: ", "openai-chat:"])
def test_error_for_an_invalid_name_says_how_models_are_named(name: str) -> None:
    with pytest.raises(UserError, match=r"not the name of a model.* recorded"):
        open_model(name, SamplingSettings())


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"temperature": -0.1}, ["temperature", " -0.1", "0 to 100"]),
        ({"temperature": float("nan")}, ["temperature", " nan", "0 to 100"]),
        ({"top_p": 0.0}, ["top-p", " 0", " 1"]),
        ({"top_p": 1.5}, ["top-p", " 1.5", " 1"]),
        ({"max_tokens": 0}, ["token limit", " 0", " 1"]),
        ({"timeout": 0.0}, ["timeout", " 0 seconds"]),
        ({"base_url": "localhost:8000"}, ["base URL", "http:// or https://"]),
        ({"base_url": "http://a:99999/v1"}, ["base URL", "host and port"]),
        ({"base_url": "http://me:sk-secret@a/v1"}, ["base URL", "password"]),
        ({"base_url": "http://a/v1?key=sk-secret"}, ["base URL", "query"]),
    ],
)
def test_settings_out_of_range_are_refused(wrong: dict[str, Any], named: list[str]) -> None:
    with pytest.raises(UserError) as caught:
        SamplingSettings(**wrong)
    assert all(name in caught.value.sentence for name in named), caught.value
    assert "sk-secret" not in str(caught.value)


def test_recorded_model_refuses_a_base_url() -> None:
    with pytest.raises(UserError, match=r"recorded.* base URL"):
        open_model("recorded", SamplingSettings(base_url="http://localhost:8000/v1"))


def test_of_several_models_one_is_enough_for_a_base_url() -> None:
    expect_server("recorded", "openai-chat:mine")
    with pytest.raises(UserError, match="recorded and recorded:hasty"):
        expect_server("recorded", "recorded:hasty")


def test_seed_grows_with_the_number_of_the_reply() -> None:
    assert SamplingSettings(seed=7).seed_of(3) == 10
    assert SamplingSettings().seed_of(3) is None
