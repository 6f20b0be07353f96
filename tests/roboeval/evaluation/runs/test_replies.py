"""Replies are shown whole or in short, or not at all if their row does not record them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from codebotler.models.no_program import NO_PROGRAM_SENTENCES
from roboeval.cli.views.completions import SHOWN_REPLY_CHARACTERS, completion_view
from roboeval.evaluation.judging.explanation import completion_data
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.replies import reply_data, reply_facts
from small_run import HOSTILE, SHOWN, SUITE, row, text_of

WRITTEN = Completion(
    task="Visit",
    prompt=0,
    index=0,
    program="I will",
    more={
        "no_program": "cut-off",
        "finish_reason": "length",
        "usage": {"input_tokens": 900, "output_tokens": 512, "reasoning_tokens": 400},
        "latency_s": 2.5,
        "reasoning": "Let me think.",
        "raw_reply": "I will",
    },
)


def view(completion: Completion, failure: tuple[str, str] | None = None, *, with_reply: bool = False) -> str:
    data = completion_data(row(0, 0, failure), completion, SUITE)
    return text_of(completion_view(data, with_reply=with_reply), width=200)


def test_facts_of_a_reply_include_its_tokens() -> None:
    data = reply_data(WRITTEN)
    assert data is not None
    assert (data["finish_reason"], data["cut_off"], data["latency_s"]) == ("length", True, 2.5)
    ended, tokens, seconds = reply_facts(data)
    assert '"length"' in ended
    assert all(number in tokens for number in ("900", "512", "400"))
    assert seconds == "2.5 s"


@pytest.mark.parametrize(
    "more",
    [{}, {"finish_reason": None, "raw_reply": None}, {"usage": {"input_tokens": 1}, "latency_s": 3.0}],
)
def test_rows_of_earlier_versions_show_no_reply(more: dict[str, Any]) -> None:
    completion = replace(WRITTEN, more=more)
    assert reply_data(completion) is None
    assert "--reply" not in view(completion, ("PythonError", "NameError"))


def test_wrong_values_of_a_row_are_left_out() -> None:
    more = {"finish_reason": 3, "usage": [1], "latency_s": "long", "reasoning": {}, "raw_reply": "x"}
    data = reply_data(replace(WRITTEN, more=more))
    assert data is not None
    assert {name: value for name, value in data.items() if value} == {"raw_reply": "x"}
    assert reply_facts(data) == []


def test_texts_are_shown_only_on_request() -> None:
    short, whole = (view(WRITTEN, ("NoProgram", "cut-off"), with_reply=shown) for shown in (False, True))
    assert "Let me think." not in short
    assert "reasoning (13 characters) and reply (6 characters): --reply" in short
    assert "\nreasoning:\nLet me think." in whole
    assert "--reply" not in whole


def test_a_reply_without_a_program_shows_the_reason_and_no_world() -> None:
    text = view(WRITTEN, ("NoProgram", "cut-off"))
    assert "no program: cut-off" in text
    assert NO_PROGRAM_SENTENCES["cut-off"] in text
    assert "World 1" not in text


def test_hostile_replies_stay_text_and_are_shortened() -> None:
    more = {
        **WRITTEN.more,
        "reasoning": HOSTILE,
        "raw_reply": "x" * (SHOWN_REPLY_CHARACTERS + 77),
        "finish_reason": HOSTILE,
    }
    text = view(replace(WRITTEN, more=more), with_reply=True)
    assert SHOWN[:20] in text
    assert "\x1b" not in text
    assert "... 77 more characters" in text
