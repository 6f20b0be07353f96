"""Convert conversations, tools and calls between our types and those of pydantic-ai."""

from __future__ import annotations

import json
from dataclasses import replace

from pydantic_ai import messages
from pydantic_ai.tools import ToolDefinition

from codebotler.models.base import Reply
from codebotler.models.no_program import classify_reply
from codebotler.prompts import PictureMessage, PromptMessage
from codebotler.prompts.tools import CallingMessage, ResultMessage, Tool, ToolCall


def to_messages(conversation: tuple[PromptMessage, ...]) -> list[messages.ModelMessage]:
    """Convert a conversation to pydantic-ai message types."""
    found: list[messages.ModelMessage] = []
    for message in conversation:
        if isinstance(message, CallingMessage):
            found += messages.ModelMessagesTypeAdapter.validate_json(message.data)
            continue
        if message.role == "assistant":
            found.append(messages.ModelResponse(parts=[messages.TextPart(message.text)]))
            continue
        part = _request_part(message)
        if found and isinstance(found[-1], messages.ModelRequest):
            found[-1] = messages.ModelRequest(parts=[*found[-1].parts, part])
        else:
            found.append(messages.ModelRequest(parts=[part]))
    return found


def _request_part(message: PromptMessage) -> messages.ModelRequestPart:
    if isinstance(message, ResultMessage):
        return messages.ToolReturnPart(message.call.name, message.text, message.call.id)
    if message.role == "system":
        return messages.SystemPromptPart(message.text)
    if not isinstance(message, PictureMessage):
        return messages.UserPromptPart(message.text)
    picture = messages.BinaryContent(message.jpeg, media_type="image/jpeg")
    return messages.UserPromptPart([message.text, picture])


def definition_of(tool: Tool) -> ToolDefinition:
    """Convert a tool to pydantic-ai's `ToolDefinition`."""
    schema = json.loads(tool.schema)
    return ToolDefinition(name=tool.name, description=tool.description, parameters_json_schema=schema)


def turn_of(reply: Reply, response: messages.ModelResponse) -> Reply:
    """Return a copy of a reply to a `ToolPrompt` with the tool calls in `response` instead of a program."""
    parts = [part for part in response.parts if isinstance(part, messages.ToolCallPart)]
    calls = tuple(ToolCall(one.tool_call_id, one.tool_name, one.args_as_json_str()) for one in parts)
    known = reply.no_program if reply.no_program in {"refusal", "filtered"} else None
    has_turn = bool(calls or (response.text and reply.program.strip()))  # the text without thoughts
    why = classify_reply(reply.text, "", reply.finish_reason, has_code=has_turn, known_kind=known)
    turn = messages.ModelMessagesTypeAdapter.dump_json([response]).decode()
    fault = None if why == "tool-call" and calls else why
    return replace(reply, program="", no_program=fault, calls=calls, turn=turn)
