"""A server on loopback whose scripted model calls tools, and which counts its requests."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from server import Request, Server

Call: TypeAlias = tuple[str, object]
"""The name of a tool and its arguments, or a text in place of them."""

Turn: TypeAlias = Sequence[Call] | str
"""A reply of the model: calls, or a text."""

INPUT_TOKENS, OUTPUT_TOKENS, REASONING_TOKENS = 100, 10, 3


@dataclass
class Agent:
    """Reply with the turns of a script, which depends on the request."""

    script: Callable[[Request], Sequence[Turn]]
    answered: Counter[str] = field(default_factory=Counter)  # It counts the requests of each turn.

    def respond(self, request: Request) -> tuple[int, dict[str, str], bytes]:
        """Answer a request with the turn that follows those in its conversation."""
        number = turns_before(request)
        turns = self.script(request)
        self.answered[json.dumps([instruction_of(request), request.body.get("seed"), number])] += 1
        return 200, {}, stream(turns[min(number, len(turns) - 1)], number)


def turns_before(request: Request) -> int:
    """Count the model's turns in this conversation; a request to write the rest of a program is turn 1."""
    if "tools" not in request.body:
        return int("ended early" in request.body["messages"][-1]["content"])
    return sum(message["role"] == "assistant" for message in request.body["messages"])


def instruction_of(request: Request) -> str:
    return str(next(one["content"] for one in request.body["messages"] if one["role"] == "user"))


def results_in(request: Request) -> list[str]:
    """Return the results of the calls that the model received."""
    return [str(one["content"]) for one in request.body["messages"] if one["role"] == "tool"]


def stream(turn: Turn, number: int) -> bytes:
    """Encode a reply as a stream of OpenAI's format."""
    if isinstance(turn, str):
        delta: dict[str, Any] = {"role": "assistant", "content": turn}
    else:
        calls = [
            {
                "index": index,
                "id": f"call-{number}-{index}",
                "type": "function",
                "function": {
                    "name": name,
                    "arguments": given if isinstance(given, str) else json.dumps(given),
                },
            }
            for index, (name, given) in enumerate(turn)
        ]
        delta = {"role": "assistant", "content": None, "tool_calls": calls}
    usage = {
        "prompt_tokens": INPUT_TOKENS,
        "completion_tokens": OUTPUT_TOKENS,
        "total_tokens": INPUT_TOKENS + OUTPUT_TOKENS,
        "completion_tokens_details": {"reasoning_tokens": REASONING_TOKENS},
    }
    reason = "stop" if isinstance(turn, str) else "tool_calls"
    chunks = [
        _chunk([{"index": 0, "delta": delta, "finish_reason": None}]),
        _chunk([{"index": 0, "delta": {}, "finish_reason": reason}]),
        _chunk([], usage),
    ]
    lines = [f"data: {json.dumps(chunk)}\n\n" for chunk in chunks]
    return "".join([*lines, "data: [DONE]\n\n"]).encode()


def _chunk(choices: list[dict[str, Any]], usage: dict[str, Any] | None = None) -> dict[str, Any]:
    return {
        "id": "reply",
        "object": "chat.completion.chunk",
        "created": 0,
        "model": "agent",
        "choices": choices,
        "usage": usage,
    }


def serve(script: Callable[[Request], Sequence[Turn]]) -> tuple[Agent, Server]:
    """Make an agent and its server, which the caller starts."""
    agent = Agent(script)
    return agent, Server(sends=agent.respond)
