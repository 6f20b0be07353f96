"""Extracts the information about replies from rows of completions.jsonl."""

from __future__ import annotations

from collections.abc import Mapping
from types import UnionType
from typing import Any

from codebotler.core.terminal import shortened
from codebotler.core.text.words import counted
from roboeval.evaluation.runs.completions import Completion

TOKENS = ("input_tokens", "output_tokens", "reasoning_tokens")
REPLY_TEXTS = ("reasoning", "raw_reply")
MAX_RECORDED = 10**12  # tokens or seconds; larger numbers cannot be measurements


def reply_data(completion: Completion) -> dict[str, Any] | None:
    """Return the information recorded about a completion's reply, or None if there is none.

    The entries are `finish_reason` in the server's words, `cut_off`, `input_tokens`, `output_tokens`,
    `reasoning_tokens`, `latency_s`, `reasoning` and `raw_reply`. Each may be None. A mission of an agent also
    has `mode`, `ending`, `turns` and `tool_errors`.
    """
    more = completion.more
    if not any(more.get(name) for name in ("finish_reason", "raw_reply", "reasoning", "ending")):
        return None
    entries = {name: more.get(name) for name in ("mode", "ending", "tool_errors")}
    return {
        "finish_reason": completion.finish_reason,
        "cut_off": completion.is_cut_off,
        **reply_numbers(completion),
        **{name: text if isinstance(text := more.get(name), str) else None for name in REPLY_TEXTS},
        **({} if completion.mission is None else {**entries, "turns": completion.turns}),
    }


def reply_numbers(completion: Completion) -> dict[str, float | None]:
    """Return a reply's token counts and its `latency_s` in seconds. Each is None if it was not recorded."""
    more = completion.more
    usage = more.get("usage")
    usage = usage if isinstance(usage, dict) else {}
    tokens = {name: number_or_none(usage.get(name), int) for name in TOKENS}
    return {**tokens, "latency_s": number_or_none(more.get("latency_s"), int | float)}


def reply_facts(reply: Mapping[str, Any]) -> list[str]:
    """Describe `reply`, from `reply_data`, in short texts such as `tokens: 60 in the reply` and `2.1 s`."""
    named = zip(TOKENS, ("in the prompt", "in the reply", "in its reasoning"), strict=True)
    tokens = [f"{reply[name]:,} {of}" for name, of in named if reply[name] is not None]
    facts = []
    if "ending" in reply:
        errors = reply["tool_errors"] if isinstance(reply["tool_errors"], dict) else {}
        counts = "".join(f", {shortened(str(kind), 100)} {count}" for kind, count in errors.items())
        turns = counted(reply["turns"], "turn")
        facts.append(f"{reply['mode']}: {turns}{counts}; ended by {reply['ending']}")
    if reply["finish_reason"] is not None:
        ended = shortened(reply["finish_reason"], 100)
        facts.append(f'finish reason "{ended}"{" (cut off)" if reply["cut_off"] else ""}')
    facts += [f"tokens: {', '.join(tokens)}"] if tokens else []
    return facts + ([] if reply["latency_s"] is None else [f"{reply['latency_s']:,.1f} s"])


def number_or_none(value: Any, kind: type | UnionType) -> float | None:  # noqa: ANN401 - JSON has no types
    """Return a value from a row if it is a number of this type, from 0 to a trillion, or else None."""
    is_number = isinstance(value, kind) and not isinstance(value, bool)
    return value if is_number and 0 <= value <= MAX_RECORDED else None
