"""A reply that is still arriving is split into text and code."""

from __future__ import annotations

import time

import pytest

from codebotler.generation.partial_reply import split_partial

CODE = "def task_program():\n    say('hello')\n"


@pytest.mark.parametrize(
    ("reply", "text", "code"),
    [
        ("", "", ""),
        ("I will greet them", "I will greet them", ""),
        ("Here it is:\n``", "Here it is:\n``", ""),
        ("Here it is:\n```python\ndef task", "Here it is:\n", "def task"),
        (f"Here it is:\n```python\n{CODE}```\nIt says hello.", "Here it is:\nIt says hello.", CODE),
        (f"```\nx = 1\n```\nBetter:\n~~~python\n{CODE}", "Better:\n", CODE),
        (CODE, "", CODE),
        (f"Sure.\n{CODE}", "Sure.\n", CODE),
        ("    say('hello')\n    go_to('hall')", "", "    say('hello')\n    go_to('hall')"),
        (" Here it is", " Here it is", ""),
        (f"<think>\n```python\n{CODE}```\nHm.", f"<think>\n```python\n{CODE}```\nHm.", ""),
        (f"<think>a\nb</think>\n{CODE}", "<think>a\nb</think>\n", CODE),
        (f"[THINK]{CODE}[/THINK]\n```\n{CODE}", f"[THINK]{CODE}[/THINK]\n", CODE),
        (f"Let me see.\n{CODE}</think>\nNow:\n", f"Let me see.\n{CODE}</think>\nNow:\n", ""),
    ],
)
def test_partial_reply_is_split_into_text_and_code(reply: str, text: str, code: str) -> None:
    found = split_partial(reply)
    assert (found.text, found.code) == (text, code)


def test_long_reply_is_split_quickly() -> None:
    began = time.process_time()
    split_partial(("Let me think about it. " * 20 + "\n") * 1_000)
    split_partial(" " * 200_000)
    assert time.process_time() - began < 0.1
