"""Test an agent with Anthropic's protocol, which requires its signed thoughts back."""

import json
from pathlib import Path
from typing import Any

import pytest

from codebotler.models.open import open_model
from codebotler.models.sampling import SamplingSettings
from roboeval.evaluation.agents.conversation import TurnLimits
from roboeval.evaluation.agents.plan import AgentPlan
from roboeval.evaluation.generating.generate import Pace, generate_run
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.suites.load import load_suite
from server import Request, Server
from small_suite import write_suite

THOUGHT = {"type": "thinking", "thinking": "The kitchen is near.", "signature": "c2lnbmVk"}
CALL = {"type": "tool_use", "id": "call-1", "name": "go_to", "input": {}}


def respond(request: Request) -> tuple[int, dict[str, str], bytes]:
    """Call go_to first, and answer in text after its result."""
    is_first = all(message["role"] == "user" for message in request.body["messages"])
    usage = {"input_tokens": 50, "output_tokens": 1}
    message = {"id": "m", "type": "message", "role": "assistant", "model": "c", "content": [], "usage": usage}
    events: list[dict[str, Any]] = [{"type": "message_start", "message": {**message, "stop_reason": None}}]
    if is_first:
        arguments = {"type": "input_json_delta", "partial_json": '{"location": "kitchen"}'}
        events += [
            {"type": "content_block_start", "index": 0, "content_block": THOUGHT},
            {"type": "content_block_stop", "index": 0},
            {"type": "content_block_start", "index": 1, "content_block": CALL},
            {"type": "content_block_delta", "index": 1, "delta": arguments},
            {"type": "content_block_stop", "index": 1},
        ]
    else:
        text = {"type": "text", "text": "Done."}
        events += [
            {"type": "content_block_start", "index": 0, "content_block": text},
            {"type": "content_block_stop", "index": 0},
        ]
    reason = "tool_use" if is_first else "end_turn"
    delta = {"stop_reason": reason, "stop_sequence": None}
    events += [
        {"type": "message_delta", "delta": delta, "usage": {"output_tokens": 20}},
        {"type": "message_stop"},
    ]
    lines = [f"event: {event['type']}\ndata: {json.dumps(event)}\n\n" for event in events]
    return 200, {}, "".join(lines).encode()


@pytest.mark.slow  # Importing the library takes seconds.
def test_thoughts_and_calls_are_sent_back_unchanged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ANTHROPIC_API_KEY", "a key")
    (tmp_path / "suite").mkdir()
    suite, run = load_suite(write_suite(tmp_path / "suite")), RunFolder(tmp_path / "run")
    with Server(sends=respond) as server:
        settings = SamplingSettings(base_url=server.url, reasoning_effort="low")
        model = open_model("anthropic:claude-sonnet-4-5", settings)
        plan = AgentPlan(suite, None, 1, mode="agent", limits=TurnLimits(5))
        progress = generate_run(run, plan, model, Pace())
    assert progress.missing is None
    _, second = server.requests
    assert {tool["name"] for tool in second.body["tools"]} > {"go_to", "give_up"}
    _, called, result = second.body["messages"]
    assert [block["type"] for block in called["content"]] == ["thinking", "tool_use"]
    assert called["content"][0]["signature"] == THOUGHT["signature"]
    assert called["content"][1]["input"] == {"location": "kitchen"}
    (answered,) = result["content"]
    assert (answered["type"], answered["tool_use_id"]) == ("tool_result", "call-1")
    (completion,) = run.read(suite)
    assert (completion.more["ending"], completion.turns) == ("answer", 2)
    assert completion.more["reasoning"] == THOUGHT["thinking"]
    assert completion.more["usage"]["output_tokens"] == 40
