"""Offer skills to a model as tools, instead of asking it for a program."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from typing import Any

from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill, SkillTable
from codebotler.core.skills.values import ValueType
from codebotler.prompts.rendering import Prompt, PromptMessage, clean_instruction, fill_template, list_lines

GIVE_UP, WAIT = "give_up", "wait"
"""The names of the two tools that are offered in addition to the skills."""

_JSON_TYPES = {"str": "string", "int": "integer", "float": "number", "bool": "boolean"}


@dataclass(frozen=True)
class Tool:
    """A function that a model may call: its name, description and JSON Schema."""

    name: str
    description: str
    schema: str  # the JSON Schema of its arguments, as JSON text


@dataclass(frozen=True)
class ToolCall:
    """A tool call that a model requests."""

    id: str  # links the result to the call
    name: str
    arguments: str  # JSON text, which may be invalid


@dataclass(frozen=True)
class CallingMessage(PromptMessage):
    """A model's turn in which it called tools."""

    data: str = field(repr=False)  # the turn as the model's library writes it, with signatures of thoughts


@dataclass(frozen=True)
class ResultMessage(PromptMessage):
    """A message that gives the model the result of a tool call, as text."""

    call: ToolCall


@dataclass(frozen=True)
class ToolPrompt(Prompt):
    """A request to carry out an instruction by calling tools."""

    tools: tuple[Tool, ...] = ()


TO_END = "When everything is done, answer with a short sentence instead of a call. This ends the mission."
"""The default sentence that tells an agent how to end its mission."""


def agent_prompt(
    instruction: str, *, rules: Sequence[str] = (), skills: SkillTable = SKILLS, to_end: str = TO_END
) -> ToolPrompt:
    """Return the prompt that asks a model to carry out an instruction by calling skills.

    Args:
        instruction: the robot's task, in plain words.
        rules: sentences that every mission must obey.
        skills: the skills that may be called.
        to_end: a sentence that tells the model how to end the mission.

    Raises:
        UserError: the instruction is empty.
    """
    instruction = clean_instruction(instruction)
    about_rules = fill_template("rules", rules=list_lines(rules)) if rules else ""
    messages = (
        PromptMessage("system", f"{fill_template('agent')}\n- {to_end}"),
        PromptMessage("user", "\n\n".join(filter(None, (instruction, about_rules)))),
    )
    return ToolPrompt(instruction, messages, instruction, (), "", tools=tools_for(skills))


def tools_for(skills: SkillTable) -> tuple[Tool, ...]:
    """Return a tool for each skill, and the tools `wait` and `give_up`."""
    found = {tool.name: tool for tool in _MORE_TOOLS}
    for skill in skills.values():
        description = " ".join([skill.doc, *(f"Fails if {when}." for _, when in skill.fails)])
        found[skill.name] = Tool(skill.name, description, schema_of(skill))
    return tuple(found.values())


def schema_of(skill: Skill) -> str:
    """Return the JSON Schema of a skill's arguments, as JSON text."""
    return object_schema({parameter.name: _schema(parameter.type) for parameter in skill.parameters})


@cache
def agent_template_hash(skills: SkillTable = SKILLS) -> str:
    """Return the SHA-256 hash, in hexadecimal, of everything in an agent's prompt except the instruction."""
    shapes = [agent_prompt("INSTRUCTION", rules=rules, skills=skills) for rules in ((), ("RULE",))]
    return hashlib.sha256(json.dumps([asdict(shape) for shape in shapes]).encode()).hexdigest()


def _schema(value: ValueType) -> dict[str, Any]:
    one: dict[str, Any] = {"type": _JSON_TYPES[value.base or "str"]}
    if value.choices:
        one["enum"] = [*value.choices]
    return {"type": "array", "items": one} if value.is_list else one


def object_schema(properties: dict[str, Any]) -> str:
    """Return, as text, the JSON Schema of an object with exactly these `properties` (schemas by name)."""
    closed = {"required": [*properties], "additionalProperties": False}
    return json.dumps({"type": "object", "properties": properties, **closed})


_MORE_TOOLS = (
    Tool(
        WAIT,
        "Let some seconds pass, and read the time afterwards.",
        object_schema({"seconds": {"type": "number"}}),
    ),
    Tool(
        GIVE_UP,
        "End the mission because the instruction cannot be carried out. Say why.",
        object_schema({"reason": {"type": "string"}}),
    ),
)
