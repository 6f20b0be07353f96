"""The HTTP API for missions, checks and the robot."""

from __future__ import annotations

import asyncio
import io
import json
from collections.abc import AsyncIterator
from dataclasses import asdict
from http import HTTPStatus
from typing import Annotated, Any, Literal, TypeAlias

from fastapi import APIRouter, Depends, Header, HTTPException, Query, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response, StreamingResponse
from pydantic import BaseModel, ConfigDict, Field

from codebotler.core.errors import UserError, installed
from codebotler.core.terminal import shortened
from codebotler.missions.display.view import MissionOrder, SessionView
from codebotler.missions.display.wording import BY_PAGE
from codebotler.missions.mission import MissionError
from codebotler.missions.session import MissionSession
from codebotler.missions.storage.log import EVENTS_FILE, LogLine, MissionSummary, read_events
from codebotler.missions.storage.store import find_mission, read_missions
from codebotler.web.console import MAX_PROGRAM_CHARACTERS, MAX_WAIT_SECONDS, Console

_CURRENT = "current"
"""In a path, this word means the current mission, as in `/api/missions/current`."""

_LimitedText = Annotated[str, Field(max_length=MAX_PROGRAM_CHARACTERS)]


WhenToAnswer: TypeAlias = Annotated[
    Literal["now", "begun", "over"],
    Query(description="Wait until a mission has begun, or until it is over, at most 15 s."),
]


class _Form(BaseModel):
    model_config = ConfigDict(extra="forbid")


class NewMission(_Form):
    """A new mission: an instruction, a program, or both. Without a program, the model writes one."""

    instruction: _LimitedText = ""
    model: Annotated[str, Field(max_length=200)] = Field("", description="By default, the first model.")
    program: _LimitedText = ""


class NewProgram(_Form):
    """A program to check, or to replace the current program."""

    program: _LimitedText


class Approval(_Form):
    """A person's approval of a program, identified by its digest, with any problems and rules to ignore."""

    program: str = Field(description="The digest of the reviewed program.", examples=["3f5a8b0c9d21e467"])
    despite_problems: bool = False
    disabled_rules: list[str] = Field([], description="The rules that are not in force, as reviewed.")


class AnswerForm(_Form):
    """A person's answer to a clarifying question: which of several behaviours the person means."""

    answer: Annotated[int, Field(ge=1)] | Literal["none", "decide"] = Field(
        description="The number of an option, from 1; `none` of them; or `decide` to take the most frequent."
    )
    more: Annotated[str, Field(max_length=10_000)] = Field(
        "", description="With `none`: what to add to the instruction."
    )


class AskAgainForm(_Form):
    """A request for another program by the model, perhaps with a new token limit."""

    repair: bool = Field(default=False, description="Whether to send the program and its problems.")
    max_tokens: Annotated[int, Field(ge=0)] = Field(
        0, description="A new token limit, such as `higher_limit` of `no_program`; 0 keeps the limit."
    )


class ContinueForm(_Form):
    """A request to do the rest of a mission that ended early, and whether its last step happened."""

    happened: bool | None = Field(
        None, description="A person's word on whether the last step happened, if the log does not say so."
    )
    answer: Annotated[str, Field(max_length=10_000)] = Field(
        "", description="The answer, if this step was a question and the person knows it."
    )


class AsciiJSONResponse(JSONResponse):
    """A JSON response in ASCII, because UTF-8 cannot encode the lone surrogates that programs may contain."""

    def render(self, content: object) -> bytes:
        """Return the body of the response: JSON without spaces, in ASCII."""
        return json.dumps(content, separators=(",", ":")).encode("ascii")


def invalid_request(_request: Request, error: Exception) -> AsciiJSONResponse:
    """Return status 422, which names the invalid fields and the reasons, but does not echo the values."""
    assert isinstance(error, RequestValidationError), "registered only for this error"
    detail = [{name: fault[name] for name in ("type", "loc", "msg")} for fault in error.errors()]
    return AsciiJSONResponse({"detail": detail}, HTTPStatus.UNPROCESSABLE_ENTITY)


def router(console: Console) -> APIRouter:
    """Create the routes below `/api` for missions, checks and the robot."""
    api = APIRouter(
        prefix="/api",
        tags=["missions"],
        default_response_class=AsciiJSONResponse,
        dependencies=[Depends(_raise_http_errors)],
    )
    _add_missions(api, console)
    _add_changes(api, console)
    _add_rest(api, console)
    return api


def _add_missions(api: APIRouter, console: Console) -> None:
    @api.get("/missions")
    def list_missions() -> list[dict[str, Any]]:
        """Return the summaries of all missions, oldest first."""
        return [asdict(summary) for summary in read_missions(console.home)]

    @api.post("/missions", status_code=201)
    async def create(new: NewMission) -> dict[str, Any]:
        """Begin a mission, and prepare its program in the background. If another runs, return status 409."""
        session = console.begin(MissionOrder(new.instruction, new.model, new.program))
        return await _begun_data(console, session)

    @api.post("/missions/{mission}/continue", status_code=201)
    async def continue_mission(mission: str, form: ContinueForm) -> dict[str, Any]:
        """Begin a mission to do the rest of another. Without an instruction, a person edits the program."""
        summary, _ = await asyncio.to_thread(_read_mission, console, mission)
        past = await asyncio.to_thread(console.past_of, summary.id)
        if form.happened is not None:
            past = past.resolve(happened=form.happened, answer=form.answer)
        session = console.begin(console.rest_of(past))
        return await _begun_data(console, session)

    @api.get("/missions/{mission}")
    def show(mission: str) -> dict[str, Any]:
        """Return a mission's summary or, for the current mission, all details, such as its check."""
        view = console.view
        if mission in {_CURRENT, view.id}:
            return view_data(view)
        return asdict(_read_mission(console, mission)[0])

    @api.get("/missions/{mission}/events.jsonl")
    def jsonl(mission: str) -> Response:
        """Download a mission's events as JSON lines."""
        summary, _ = _read_mission(console, mission)
        data = (console.home / "missions" / summary.id / EVENTS_FILE).read_bytes()
        return _file(data[: data.rfind(b"\n") + 1], f"{summary.id}.jsonl", "application/jsonl")

    @api.get("/missions/{mission}/events.mcap")
    def mcap(
        mission: str,
        clock: Annotated[Literal["wall", "robot"], Query(description="`robot` for simulated time.")] = "wall",
    ) -> Response:
        """Download a mission's events as an MCAP file, for Foxglove."""
        with installed():
            from codebotler.missions.storage.mcap import write_mcap  # noqa: PLC0415 - part of an optional extra

        summary, events = _read_mission(console, mission)
        file = io.BytesIO()
        folder = console.home / "missions" / summary.id
        write_mcap(file, summary, events, folder=folder, clock=clock)
        return _file(file.getvalue(), f"{summary.id}.mcap", "application/octet-stream")


def _add_changes(api: APIRouter, console: Console) -> None:
    @api.put("/missions/{mission}/program")
    def edit(mission: str, new: NewProgram) -> dict[str, Any]:
        """Replace the mission's program, and check the new one in the background."""
        _current_session(console, mission)
        return view_data(console.edit(new.program).view)

    @api.post("/missions/{mission}/again", status_code=202)
    def ask_again(mission: str, again: AskAgainForm) -> dict[str, Any]:
        """Ask the model for another program, and check it."""
        session = _current_session(console, mission)
        session.ask_again(repair=again.repair, max_tokens=again.max_tokens or None)
        return view_data(session.view)

    @api.post("/missions/{mission}/answer", status_code=202)
    def answer(mission: str, given: AnswerForm) -> dict[str, Any]:
        """Answer the mission's `question`, which asks which of several behaviours is meant."""
        session = _current_session(console, mission)
        chosen = given.answer if isinstance(given.answer, str) else given.answer - 1
        session.answer(session.view.question, chosen, given.more)
        return view_data(session.view)

    @api.post("/missions/{mission}/approve")
    def approve(mission: str, approval: Approval) -> dict[str, Any]:
        """Run the program that a person has reviewed, identified by its digest."""
        session = _current_session(console, mission)
        session.approve(
            approval.program,
            despite_problems=approval.despite_problems,
            disabled_rules=tuple(approval.disabled_rules),
        )
        return view_data(session.view)

    @api.post("/stop", status_code=202)
    async def stop(
        *,
        only_moving: Annotated[
            bool, Query(description="Stop only a program that is approved or runs.")
        ] = False,
    ) -> dict[str, Any]:
        """Stop the current mission. Return whether there was one, and a warning if a robot was lost."""
        stopping = console.stop(BY_PAGE, only_moving=only_moving, holds=True)
        return {"stopping": stopping, "warning": console.warning or console.used_elsewhere}

    @api.get("/missions/{mission}/events", response_class=StreamingResponse)
    async def events(mission: str, last_event_id: Annotated[int, Header(ge=0)] = 0) -> StreamingResponse:
        """Stream the mission's events as server-sent events, from the first or after `Last-Event-ID`."""
        return StreamingResponse(
            _stream(console, _current_session(console, mission), last_event_id),
            media_type="text/event-stream",
            headers={"cache-control": "no-store"},
        )


def _add_rest(api: APIRouter, console: Console) -> None:
    @api.post("/check", tags=["checks"])
    def check(new: NewProgram) -> dict[str, Any]:
        """Check a program against the house rules and, if there is a current mission, in its rooms."""
        return console.check(new.program, console.view.room_map, console.rules).data()

    @api.get("/robot", tags=["robot"])
    async def robot(once: WhenToAnswer = "now") -> dict[str, Any]:
        """Return the robot, its skills and the mission, either now or once the mission has begun or ended."""
        view = console.view if once == "now" else await console.view_once(over=once == "over")
        return {
            "robot": console.robot.name,
            "skills": [skill.signature for skill in console.robot.skills.values()],
            "missing": dict(console.robot.missing),
            "models": list(console.models),
            "has_face": console.face is not None,
            "interrupted": [asdict(summary) for summary in console.interrupted],
            "mission": view.id,
            "state": view.state,
            "reason": view.reason,
            "has_begun": view.progress.has_begun,
            "is_over": view.is_over,
        }


async def _begun_data(console: Console, session: MissionSession) -> dict[str, Any]:
    """Return the view of a session once its mission exists."""
    await console.notifier.until(lambda: bool(session.view.id) or session.view.is_over)
    if not session.view.id:
        raise HTTPException(409, session.view.error or "the mission was stopped before it started")
    return view_data(session.view)


async def _stream(console: Console, session: MissionSession, known: int) -> AsyncIterator[str]:
    """Yield server-sent events. A slow client misses no events, and delays no other client."""

    def has_more() -> bool:
        return bool(session.events(known)) or session.view.is_over

    while True:
        for line in session.events(known):
            known += 1
            yield f"id: {known}\nevent: {line['event']}\ndata: {json.dumps(line)}\n\n"
        if session.view.is_over and not session.events(known):
            return
        if not await console.notifier.until(has_more, MAX_WAIT_SECONDS):
            if console.notifier.is_closed:
                return
            yield ": still there\n\n"


def view_data(view: SessionView) -> dict[str, Any]:
    """Convert the view of a mission, with its state, program and check, to data for JSON."""
    as_in_view = (
        *("id", "state", "phase", "busy", "instruction", "model", "author", "digest", "is_written"),
        *("problems", "unknown_rooms", "remarks", "reason", "line", "is_over"),
    )
    return {name: getattr(view, name) for name in as_in_view} | {
        "trouble": view.error,
        "past": None if view.past is None else {"mission": view.past.mission, "steps": view.past.steps},
        "program": view.arriving.code if view.is_written else view.program,
        "no_program": None if view.programless is None else asdict(view.programless),
        "question": None if view.question is None else asdict(view.question),
        "rules": [
            {"name": r.name, "says": r.says, "in_force": r.name not in view.disabled_rules}
            for r in view.rules
        ],
        "check": None if view.check is None else view.check.data(),
        "doing": view.progress.doing,
        "clock": view.progress.clock,
    }


def _current_session(console: Console, mission: str) -> MissionSession:
    session = console.session
    if session is not None and mission in {_CURRENT, session.view.id}:
        return session
    summary, _ = _read_mission(console, mission)
    raise HTTPException(409, f"mission {summary.id} is over and can only be read")


def _read_mission(console: Console, mission: str) -> tuple[MissionSummary, list[LogLine]]:
    name = console.view.id if mission == _CURRENT else mission
    if not name:
        raise HTTPException(404, "there is no current mission; POST /api/missions starts one")
    try:
        folder = find_mission(console.home, name)
    except UserError:
        sentence = f"there is no mission {shortened(name, 100)}; GET /api/missions lists them"
        raise HTTPException(404, sentence) from None
    try:
        return MissionSummary.read(folder), read_events(folder)
    except UserError as error:
        raise HTTPException(404, error.sentence) from None


async def _raise_http_errors() -> AsyncIterator[None]:  # needs no thread, which STOP might have to wait for
    """Convert MissionError to status 409 and UserError to 422."""
    try:
        yield
    except MissionError as error:
        raise HTTPException(409, error.sentence) from None
    except UserError as error:
        raise HTTPException(422, str(error)) from None


def _file(data: bytes, name: str, kind: str) -> Response:
    headers = {"content-disposition": f'attachment; filename="{name}"', "cache-control": "no-store"}
    return Response(data, media_type=kind, headers=headers)
