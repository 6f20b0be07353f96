"""The tools that agents call. None of them approves a mission."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from contextlib import aclosing, contextmanager, suppress
from functools import partial
from typing import Annotated, Any

import anyio
from mcp.server.elicitation import AcceptedElicitation, DeclinedElicitation, ElicitationResult
from mcp.server.mcpserver.resolve import Resolve
from pydantic import Field

from codebotler.agents.dialogs import (
    MAX_WORDING,
    AgentContext,
    Choice,
    Consent,
    NotAsked,
    OpenQuestion,
    ProposedProgram,
    StepWord,
    agent_name,
    as_tool_errors,
    ask_person,
    ask_whether,
    ask_which_behaviour,
    find_proposed,
    find_question,
    gatekeeper_of,
    read_last_past,
)
from codebotler.agents.gatekeeper import MAX_REPORTED_EVENTS, Gatekeeper
from codebotler.agents.reports import CheckReport, MissionReport, RobotReport, SkillOutcome
from codebotler.core.errors import UserError
from codebotler.missions.authoring import ModelAuthor, prompt_of
from codebotler.missions.display.view import MissionOrder, SessionView
from codebotler.missions.display.wording import event_text
from codebotler.missions.mission import MissionError
from codebotler.missions.session import MissionSession
from codebotler.missions.storage.past import MissionPast
from codebotler.prompts import clean_instruction
from codebotler.web.console import MAX_PROGRAM_CHARACTERS

MAX_UNREAD_SECONDS = 2.0
"""How long a client may leave a message about progress unread."""

_Instruction = Annotated[
    str,
    Field(max_length=MAX_WORDING, description="What the robot should do, in plain words for people."),
]
_Program = Annotated[
    str,
    Field(
        max_length=MAX_PROGRAM_CHARACTERS,
        description="The whole program, which defines task_program(). If optional, a model writes it.",
    ),
]
_Digest = Annotated[str, Field(description="The digest of the program, from propose_mission or begin_steps.")]
_Key = Annotated[str, Field(description="The key `steps` from begin_steps.")]
_After = Annotated[int, Field(ge=0, description="Leave out this many earlier events.")]
_Seconds = Annotated[
    float, Field(ge=0, le=600, description="How long to wait. Then the answer says how far the mission is.")
]


def read_robot(ctx: AgentContext) -> RobotReport:
    """Read the robot's rooms, its skills, the house rules, and how to write a program for it.

    Call this tool first. It changes nothing.
    """
    return gatekeeper_of(ctx).report_robot()


async def check_program(program: _Program, ctx: AgentContext) -> CheckReport:
    """Check a program in imagined worlds, and return its problems and what the robot would do.

    This tool uses no robot and needs no approval. Correct all problems before you propose the program.
    """
    gatekeeper = gatekeeper_of(ctx)
    with as_tool_errors():
        return await gatekeeper.run_exclusively("check", partial(gatekeeper.check, program))


async def write_program(instruction: _Instruction, ctx: AgentContext) -> CheckReport:
    """Have CodeBotler's own language model write a program, and check it. Nothing is run.

    You may also write the program yourself; read_robot explains how.
    """
    gatekeeper, console = gatekeeper_of(ctx), gatekeeper_of(ctx).console
    with as_tool_errors():
        if not gatekeeper.writes:
            raise UserError("no model is configured; write the program yourself, as read_robot explains")
        wanted, room_map = clean_instruction(instruction), console.view.room_map
        asked = SessionView(instruction=wanted, room_map=room_map, rules=console.rules)
        author = ModelAuthor(console.open_model, console.models[0])
        prompt = prompt_of(asked, console.robot, repair=False)
        try:
            work = partial(gatekeeper.write, author, prompt)
            return await gatekeeper.run_exclusively("request to the model", work)
        finally:
            author.cancel()


async def propose_mission(
    ctx: AgentContext, instruction: _Instruction = "", program: _Program = ""
) -> MissionReport:
    """Propose a mission: the program is checked and shown to a person. The robot does not move.

    Without a program, CodeBotler's model writes one, if a model is configured.
    You get the problems, storyboards and a digest. You cannot approve it yourself. Call run_mission, which
    waits until a person has approved exactly this program.
    """
    gatekeeper = gatekeeper_of(ctx)
    with as_tool_errors(), gatekeeper.waiting():
        author = agent_name(ctx) if program.strip() else ""
        session = gatekeeper.propose(MissionOrder(instruction, program=program, author=author))
        return await _prepared(gatekeeper, session)


async def choose_behaviour(
    ctx: AgentContext,
    question: Annotated[OpenQuestion, Resolve(find_question)],
    answer: Annotated[ElicitationResult[Choice | NotAsked], Resolve(ask_which_behaviour)],
) -> MissionReport:
    """Let the person choose between several behaviours, if the proposed mission waits for this choice.

    You cannot choose for them. The result contains the chosen program, which still needs approval.
    """
    gatekeeper = gatekeeper_of(ctx)
    with as_tool_errors():
        if not isinstance(answer, AcceptedElicitation) or isinstance(answer.data, NotAsked):
            raise MissionError(f"a person must choose a behaviour on the page {gatekeeper.page}")
        given = answer.data
        question.session.answer(question.asked, question.asked.parse(given.answer), given.more)
        with gatekeeper.waiting():
            return await _prepared(gatekeeper, question.session)


async def continue_mission(
    ctx: AgentContext,
    past: Annotated[MissionPast, Resolve(read_last_past)],
    answer: Annotated[ElicitationResult[StepWord | NotAsked], Resolve(ask_whether)],
    program: _Program = "",
) -> MissionReport:
    """Propose the rest of the last mission, which failed or was stopped. The robot does not move.

    `done_before` lists what the robot has done, which the rest must not repeat. Without a program for the
    rest, CodeBotler's model writes it. Then call run_mission.
    """
    gatekeeper = gatekeeper_of(ctx)
    with as_tool_errors(), gatekeeper.waiting():
        if isinstance(answer, AcceptedElicitation) and not isinstance(answer.data, NotAsked):
            past = past.resolve(happened=answer.data.answer == "it happened")
        if past.unsure is not None:
            raise UserError(f"{past.unsure_step_text}; ask a person to answer at {gatekeeper.page}")
        if not program.strip() and not past.instruction:
            raise UserError(f"mission {past.mission} has no instruction; send a program for the rest")
        author = agent_name(ctx) if program.strip() else ""
        session = gatekeeper.propose(gatekeeper.console.rest_of(past, program, author))
        return await _prepared(gatekeeper, session)


async def begin_steps(
    ctx: AgentContext,
    purpose: Annotated[
        str, Field(min_length=1, max_length=500, description="What you want to do, for people.")
    ],
    contract: Annotated[
        dict[str, dict[str, Any]],
        Field(
            description="What you may call at most; ask only for what you need. For each skill, give the "
            'allowed texts of each argument, or "any", such as {"go_to": {"location": ["kitchen"]}, "say": '
            '{"message": ["I found {}"]}}. "at most" limits the number of calls; "in" names the rooms for '
            "pick and place."
        ),
    ],
) -> MissionReport:
    """Propose a mission in which you call skills one at a time, instead of writing a program.

    Call run_mission with the digest, which waits until a person has approved it. Then call call_skill with
    the key `steps` as often as you need, and end_steps at the end.
    """
    gatekeeper = gatekeeper_of(ctx)
    with as_tool_errors(), gatekeeper.waiting():
        session, steps = gatekeeper.propose_steps(purpose, contract, agent_name(ctx))
        report = await _prepared(gatekeeper, session)
    return report.model_copy(update={"steps": steps.key})


async def run_mission(
    digest: _Digest,
    ctx: AgentContext,
    proposed: Annotated[ProposedProgram, Resolve(find_proposed)],
    answer: Annotated[ElicitationResult[Consent | NotAsked], Resolve(ask_person)],
    seconds: _Seconds = 45,
) -> MissionReport:
    """Run a proposed mission on the robot as soon as a person has approved it, and follow it to its end.

    A person approves on the page or, if this client can ask, in a dialog. If nobody approves it in time, or
    the mission is still running, the answer says so. Then call run_mission or follow_mission again. If you
    cancel this call while the robot works, the robot stops.
    """
    gatekeeper, session = gatekeeper_of(ctx), proposed.session
    with as_tool_errors():
        _take_answer(gatekeeper, proposed, digest, answer, agent_name(ctx))
        # If too many calls wait, the report still says what was approved.
        with suppress(MissionError), gatekeeper.waiting(), _stopping_if_cancelled(session, agent_name(ctx)):
            await _follow(gatekeeper, session, ctx, seconds)
    return gatekeeper.report(session)


async def follow_mission(ctx: AgentContext, after: _After = 0, seconds: _Seconds = 45) -> MissionReport:
    """Wait up to `seconds` for the current mission to end, and return what has happened so far.

    The tool reports progress while it waits. Cancelling this call does not stop the robot.
    """
    gatekeeper = gatekeeper_of(ctx)
    session = gatekeeper.console.session
    if session is not None:
        with as_tool_errors(), gatekeeper.waiting():
            await _follow(gatekeeper, session, ctx, seconds, after)
    return gatekeeper.report(session, after)


async def call_skill(
    steps: _Key,
    name: Annotated[str, Field(description="The name of the skill, such as go_to.")],
    ctx: AgentContext,
    arguments: Annotated[dict[str, Any] | None, Field(description="Its arguments by name.")] = None,
) -> SkillOutcome:
    """Call one skill in an approved step-by-step mission, and wait for its result.

    Each call is first checked against the house rules. If you cancel this call, the robot stops.
    """
    with as_tool_errors():
        session, known = gatekeeper_of(ctx).find_steps(steps)
        with gatekeeper_of(ctx).waiting(), _stopping_if_cancelled(session, agent_name(ctx)):
            called = known.call(name, arguments or {})
            return await asyncio.shield(asyncio.wrap_future(called))


async def end_steps(steps: _Key, ctx: AgentContext) -> MissionReport:
    """End a step-by-step mission, so that the robot is free for others."""
    gatekeeper = gatekeeper_of(ctx)
    with as_tool_errors():
        session, known = gatekeeper.find_steps(steps)
        known.end()
        with gatekeeper.waiting():
            await gatekeeper.console.notifier.until(lambda: session.view.is_over, 15)
    return gatekeeper.report(session)


async def stop(ctx: AgentContext) -> MissionReport:
    """Stop the robot and the current mission at once. This needs no approval and always works.

    Call this whenever anything is wrong, even while another call is waiting.
    """
    gatekeeper = gatekeeper_of(ctx)
    console, session = gatekeeper.console, gatekeeper.console.session
    if console.stop(agent_name(ctx)) and session is not None:
        await console.notifier.until(lambda: session.view.is_over, 15)
    report, elsewhere = gatekeeper.report(session), console.used_elsewhere
    not_stopped = f"NOT STOPPED: {elsewhere}; a person must stop it, on any page of the robot."
    return report.model_copy(update={"next": not_stopped}) if elsewhere else report


READING: Sequence[Callable[..., object]] = (read_robot, check_program, follow_mission, write_program)
ACTING: Sequence[Callable[..., object]] = (
    propose_mission,
    choose_behaviour,
    continue_mission,
    begin_steps,
    run_mission,
    call_skill,
    end_steps,
    stop,
)


def _take_answer(
    gatekeeper: Gatekeeper,
    proposed: ProposedProgram,
    digest: str,
    answer: ElicitationResult[Consent | NotAsked],
    client: str,
) -> None:
    """Approve the program if a person or a contract accepts it. End the mission if a person declines."""
    session, person = proposed.session, f"a person, asked by {client}"
    view = session.view
    match answer:
        case AcceptedElicitation(data=NotAsked()):
            if gatekeeper.approves_alone(session):
                session.approve(digest, by=f"the contract given at the start, for {client}", is_person=False)
        case AcceptedElicitation(data=Consent(approve=True)):
            if view.may_be_approved:  # otherwise somebody has approved it on the page meanwhile
                if gatekeeper.console.presses != proposed.presses:
                    raise MissionError("somebody pressed STOP since the question; call run_mission again")
                if view.problems != proposed.problems:
                    raise MissionError("the problems of the program have changed; call run_mission again")
                despite, disabled = bool(view.problems), proposed.disabled_rules
                session.approve(digest, despite_problems=despite, disabled_rules=disabled, by=person)
        case AcceptedElicitation() | DeclinedElicitation() if view.digest == digest:
            session.stop_soon(person)


async def _prepared(gatekeeper: Gatekeeper, session: MissionSession) -> MissionReport:
    """Wait until a program can be approved, or cannot be made."""

    def is_ready() -> bool:
        view = session.view
        return view.is_over or view.may_be_approved or view.waits_for_program or view.waits_for_answer

    try:
        await gatekeeper.console.notifier.until(is_ready)
    except anyio.get_cancelled_exc_class():
        session.stop_soon("the agent, which gave up")
        raise
    return gatekeeper.report(session)


async def _follow(
    gatekeeper: Gatekeeper, session: MissionSession, ctx: AgentContext, seconds: float, known: int = 0
) -> None:
    """Report new events as progress until the mission is over, or steps may begin, for some seconds.

    A client that does not read is not followed, since the call would take a place from others.
    """
    known = max(known, len(session.events()) - MAX_REPORTED_EVENTS)
    with suppress(TimeoutError):
        async with asyncio.timeout(seconds), aclosing(gatekeeper.console.notifier.changes()) as changes:
            async for _ in changes:
                is_last = session.view.is_over or gatekeeper.takes_steps(session)
                for line in session.events(known):
                    known += 1
                    if text := event_text(line):
                        async with asyncio.timeout(MAX_UNREAD_SECONDS):
                            await ctx.report_progress(known, message=text)
                if is_last:
                    return


@contextmanager
def _stopping_if_cancelled(session: MissionSession, by: str) -> Iterator[None]:
    try:
        yield
    except anyio.get_cancelled_exc_class():
        if session.view.is_approved:
            session.stop_soon(f"{by}, which cancelled its call")
        raise
