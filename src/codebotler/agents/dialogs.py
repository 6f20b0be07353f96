"""The questions that agents' clients ask their person: to approve, to choose, and what happened."""

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
from codebotler.agents.reports import question, which_question
from codebotler.candidates.question import ClarifyingQuestion
from codebotler.core.errors import UserError
from codebotler.core.terminal import shortened
from codebotler.missions.mission import MissionError
from codebotler.missions.session import MissionSession
from codebotler.missions.storage.past import MissionPast
from codebotler.models.base import ModelError

MAX_ARGUMENT = 10_000
"""The limit for an instruction, in characters."""

AgentContext: TypeAlias = Context[Gatekeeper, Any]


class NotAsked(BaseModel):
    """The answer to a question that nobody was asked."""


class Consent(BaseModel):
    """The form in which a client asks its person."""

    approve: bool = Field(
        title="Run it on the robot", description="Tick this to let the robot do exactly this."
    )


class Choice(BaseModel):
    """The form in which a client asks its person which behaviour they mean."""

    answer: Literal["1", "2", "3", "none", "you decide"] = Field(title="Which did you mean?")
    more: str = Field(default="", max_length=MAX_ARGUMENT, title="If none: what should be different?")


class StepWord(BaseModel):
    """The form in which a client asks its person about an unsure step."""

    answer: Literal["it happened", "it did not happen"] = Field(title="Did this happen?")


# --- who is asked, and what about


class OpenQuestion(NamedTuple):
    """A question about behaviours, and the mission that waits for its answer."""

    session: MissionSession
    asked: ClarifyingQuestion


async def find_question(ctx: AgentContext) -> OpenQuestion:
    """Return the question that the current mission asks a person."""
    session = gatekeeper_of(ctx).console.session
    view = None if session is None else session.view
    if session is None or view is None or view.question is None or not view.waits_for_answer:
        raise ToolError("no mission waits for such an answer")
    return OpenQuestion(session, view.question)


def ask_which_behaviour(
    question: Annotated[OpenQuestion, Resolve(find_question)], ctx: AgentContext
) -> Elicit[Choice] | NotAsked:
    """Have the client ask its person which behaviour they mean, if it can."""
    if not gatekeeper_of(ctx).asks_client or not _has_dialogs(ctx):
        return NotAsked()
    return Elicit(f"Mission {question.session.view.id}: {which_question(question.asked)}", Choice)


async def read_last_past(ctx: AgentContext) -> MissionPast:
    """Return the past of the last mission, or the one that the current mission continues."""
    gatekeeper, console = gatekeeper_of(ctx), gatekeeper_of(ctx).console
    with as_tool_errors():
        if console.view.past is not None and not console.view.is_over:
            return console.view.past
        return await gatekeeper.alone(READING_PAST, partial(console.past_of, "last"))


def ask_whether(
    past: Annotated[MissionPast, Resolve(read_last_past)], ctx: AgentContext
) -> Elicit[StepWord] | NotAsked:
    """Have the client ask its person whether an unsure step happened, beside what the log says."""
    gatekeeper = gatekeeper_of(ctx)
    if past.unsure is None or not gatekeeper.asks_client or not _has_dialogs(ctx):
        return NotAsked()
    asked = f"Mission {past.mission}: {past.question}\n{past.was}".rstrip()  # the ID binds the answer to it
    return Elicit(asked, StepWord)  # without the robot's own word, since an agent may not occupy the robot


class ProposedProgram(NamedTuple):
    """A mission that waits for approval, with its problems and rules when a person was asked."""

    session: MissionSession
    problems: tuple[str, ...]
    disabled_rules: tuple[str, ...]


async def find_program(digest: str, ctx: AgentContext) -> ProposedProgram:
    """Return the mission whose program has a digest."""
    with as_tool_errors():
        session = gatekeeper_of(ctx).find_session(digest)
    view = session.view
    return ProposedProgram(session, view.problems, view.disabled_rules)


def ask_person(
    proposed: Annotated[ProposedProgram, Resolve(find_program)], ctx: AgentContext
) -> Elicit[Consent] | NotAsked:
    """Have the client ask its person, unless the program is already approved or the client cannot ask."""
    gatekeeper, session = gatekeeper_of(ctx), proposed.session
    view = session.view
    may_ask = view.may_be_approved and gatekeeper.may_ask_client(view) and _has_dialogs(ctx)
    if not may_ask or gatekeeper.approves_alone(session):
        return NotAsked()
    return Elicit(question(view, gatekeeper.console.robot, gatekeeper.contract_text(view.contract)), Consent)


# --- the agent and its client


def gatekeeper_of(ctx: AgentContext) -> Gatekeeper:
    """Return what the server's tools share."""
    return ctx.request_context.lifespan_context


def agent_name(ctx: AgentContext) -> str:
    """Return the agent's name for logs, as its client gives it."""
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
    """Tell agents about mistakes in a sentence."""
    try:
        yield
    except (UserError, MissionError, ModelError) as error:
        raise ToolError(error.sentence) from None
