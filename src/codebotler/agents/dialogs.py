"""Ask the person behind an agent in a dialog of its client: to approve, to choose, or what happened."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

from mcp.server.mcpserver import Context
from mcp.server.mcpserver.exceptions import ToolError
from mcp.server.mcpserver.resolve import Elicit, Resolve
from pydantic import BaseModel, Field

from codebotler.agents.gatekeeper import READING_PAST, Gatekeeper
from codebotler.agents.reports import approval_text, choice_text
from codebotler.candidates.question import ClarifyingQuestion
from codebotler.core.errors import UserError
from codebotler.core.terminal import shortened
from codebotler.missions.mission import MissionError
from codebotler.missions.session import MissionSession
from codebotler.missions.storage.past import MissionPast
from codebotler.models.base import ModelError

MAX_WORDING = 10_000
"""The limit for an instruction, in characters."""

AgentContext: TypeAlias = Context[Gatekeeper, Any]


class NotAsked(BaseModel):
    """The answer if the person saw no dialog, for example because the client does not support dialogs."""


class Consent(BaseModel):
    """A dialog in which a person approves or declines a program."""

    approve: bool = Field(
        title="Run it on the robot", description="Tick this to let the robot do exactly this."
    )


class Choice(BaseModel):
    """A dialog in which a person chooses between programs that behave differently."""

    answer: Literal["1", "2", "3", "none", "you decide"] = Field(title="Which did you mean?")
    more: str = Field(default="", max_length=MAX_WORDING, title="If none: what should be different?")


class StepWord(BaseModel):
    """A dialog in which a person says whether the robot completed a step, since the log does not show it."""

    answer: Literal["it happened", "it did not happen"] = Field(title="Did this happen?")


# --- who is asked, and what about


class OpenQuestion(NamedTuple):
    """A mission that waits for a person to choose a behaviour, and the question to ask."""

    session: MissionSession
    asked: ClarifyingQuestion


async def find_question(ctx: AgentContext) -> OpenQuestion:
    """Return the open question of the current mission. Raise ToolError if no question is open."""
    session = gatekeeper_of(ctx).console.session
    view = None if session is None else session.view
    if session is None or view is None or view.question is None or not view.waits_for_answer:
        sentence = "no mission waits for a choice between behaviours; call follow_mission to see its state"
        raise ToolError(sentence)
    return OpenQuestion(session, view.question)


def ask_which_behaviour(
    question: Annotated[OpenQuestion, Resolve(find_question)], ctx: AgentContext
) -> Elicit[Choice] | NotAsked:
    """Return the dialog to choose a behaviour, or NotAsked if the client may not or cannot show dialogs."""
    if not gatekeeper_of(ctx).asks_client or not _has_dialogs(ctx):
        return NotAsked()
    return Elicit(f"Mission {question.session.view.id}: {choice_text(question.asked)}", Choice)


async def read_last_past(ctx: AgentContext) -> MissionPast:
    """Return what the mission to continue has done: one already being continued, or else the last mission."""
    gatekeeper, console = gatekeeper_of(ctx), gatekeeper_of(ctx).console
    with as_tool_errors():
        if console.view.past is not None and not console.view.is_over:
            return console.view.past
        return await gatekeeper.run_exclusively(READING_PAST, partial(console.past_of, "last"))


def ask_whether(
    past: Annotated[MissionPast, Resolve(read_last_past)], ctx: AgentContext
) -> Elicit[StepWord] | NotAsked:
    """Return the dialog about an uncertain step; NotAsked if none is uncertain or no dialog is possible."""
    gatekeeper = gatekeeper_of(ctx)
    if past.unsure is None or not gatekeeper.asks_client or not _has_dialogs(ctx):
        return NotAsked()
    text = f"Mission {past.mission}: {past.unsure_step_text}\n{past.last_position_text}".rstrip()
    return Elicit(text, StepWord)  # binds the answer to the mission; an agent may not ask the robot itself


AFTER_HOLD = "After a STOP or a lost robot, your yes also lets agents act within their contract again."


class ProposedProgram(NamedTuple):
    """A mission to approve, with the problems and the switched-off house rules to show to the person."""

    presses: int  # of STOP, before the person is asked
    session: MissionSession
    problems: tuple[str, ...]
    disabled_rules: tuple[str, ...]


async def find_proposed(digest: str, ctx: AgentContext) -> ProposedProgram:
    """Return the mission to approve. Raise ToolError if the current mission does not have this digest."""
    presses = gatekeeper_of(ctx).console.presses
    with as_tool_errors():
        session = gatekeeper_of(ctx).find_session(digest)
    view = session.view
    return ProposedProgram(presses, session, view.problems, view.disabled_rules)


def ask_person(
    proposed: Annotated[ProposedProgram, Resolve(find_proposed)], ctx: AgentContext
) -> Elicit[Consent] | NotAsked:
    """Return the dialog to approve a program, or NotAsked if it is not needed or cannot be shown."""
    gatekeeper, session = gatekeeper_of(ctx), proposed.session
    view = session.view
    may_ask = view.may_be_approved and gatekeeper.may_ask_client(view) and _has_dialogs(ctx)
    if not may_ask or gatekeeper.approves_alone(session):
        return NotAsked()
    text = approval_text(view, gatekeeper.console.robot, gatekeeper.contract_text(view.contract))
    if gatekeeper.console.is_held:
        text = f"{gatekeeper.console.warning}\n{AFTER_HOLD}\n\n{text}".lstrip()
    return Elicit(text, Consent)


# --- the agent and its client


def gatekeeper_of(ctx: AgentContext) -> Gatekeeper:
    """Return the gatekeeper that all tools of the server share."""
    return ctx.request_context.lifespan_context


def agent_name(ctx: AgentContext) -> str:
    """Return an agent's name for logs, such as `agent "claude-code"`; `an agent` if its client gives none."""
    known = ctx.session.client_params
    if known is None:
        return "an agent"
    name = shortened(known.client_info.name, 60).replace('"', "'")
    return f'agent "{name}"'


def _has_dialogs(ctx: AgentContext) -> bool:
    capabilities = ctx.client_capabilities
    forms = None if capabilities is None else capabilities.elicitation
    return forms is not None and (forms.form is not None or forms.url is None)


@contextmanager
def as_tool_errors() -> Iterator[None]:
    """In a `with` block, turn our own errors into a ToolError, whose sentence the agent can read."""
    try:
        yield
    except (UserError, MissionError, ModelError) as error:
        raise ToolError(error.sentence) from None
