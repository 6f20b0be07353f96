"""The page and the API of the robot's face: a screen where people answer the robot, or stop it."""

from __future__ import annotations

import asyncio
import math
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from fastapi import APIRouter, HTTPException, Request, WebSocket, WebSocketDisconnect
from fastapi.responses import HTMLResponse
from pydantic import BaseModel, ConfigDict, Field

from codebotler.core.terminal import shortened, visible_lines
from codebotler.missions.mission import UNCONFIRMED_STOP
from codebotler.robots.base import AnswerError
from codebotler.robots.face import Face, FaceQuestion
from codebotler.web.api import WhenToAnswer
from codebotler.web.console import Console
from codebotler.web.security.access import Role

_FACE_PAGE = Path(__file__).with_name("static") / "face.html"
_FACE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'; require-trusted-types-for 'script'"
)
"""Stricter than the policy of NiceGUI's pages: no script can turn text into markup."""

BY_FACE = "a person at the face"
_BACK_LINK = '<a id="back" href="./">Operate the robot</a>'
_BACK_PLACEHOLDER = "<!-- back -->"  # replaced by the link for operators
MAX_FACE_TEXT, MAX_FACE_OPTION, MAX_FACE_OPTIONS = 2_000, 300, 50
"""The maximum lengths of a string and an option in characters, and the maximum number of options."""


class FaceAnswer(BaseModel):
    """A person's answer to the robot's question."""

    model_config = ConfigDict(extra="forbid")
    question: int = Field(strict=True, ge=1, description="The number of the question.")
    option: int = Field(strict=True, ge=0, description="The position of the chosen option, from 0.")


def router(console: Console, face: Face) -> APIRouter:
    """Create the routes of the page `/face` and of the API below `/api/face`."""
    routes = APIRouter(tags=["face"])

    @routes.get("/face", include_in_schema=False)
    def page(request: Request) -> HTMLResponse:
        headers = {"content-security-policy": _FACE_POLICY, "cache-control": "no-store"}
        may_operate = getattr(request.state, "role", None) is Role.OPERATOR
        shown = _FACE_PAGE.read_text(encoding="utf-8").replace(
            _BACK_PLACEHOLDER, _BACK_LINK if may_operate else ""
        )
        return HTMLResponse(shown, headers=headers)

    @routes.get("/api/face")
    async def show(once: WhenToAnswer = "now") -> dict[str, Any]:
        """Return what the robot does, says and asks: now, or once the mission has begun or ended."""
        if once != "now":
            await console.view_once(over=once == "over")
        return face_data(console, face)

    @routes.post("/api/face/answer")
    def answer(given: FaceAnswer) -> dict[str, Any]:
        """Answer the robot's question. Only the first answer counts; later answers get status 409."""
        try:
            face.answer(given.question, given.option)
        except AnswerError as error:
            raise HTTPException(409, error.sentence) from None
        return face_data(console, face)

    @routes.post("/api/face/stop", status_code=202)
    async def stop() -> dict[str, Any]:
        """Stop a mission that is approved or runs, and return whether there was one to stop."""
        stopping = console.stop(BY_FACE, only_moving=True, holds=True)
        return {"stopping": stopping, "warning": bool(console.warning or console.used_elsewhere)}

    @routes.websocket("/api/face/live")
    async def live(socket: WebSocket) -> None:
        """Stream what the robot says and asks: now, and after each change. Ignore incoming messages."""
        await socket.accept()
        with face.count_screen():
            sending = asyncio.create_task(_send_changes(socket, console, face))
            try:
                with suppress(WebSocketDisconnect, KeyError):  # not a text message
                    while True:
                        await socket.receive_text()
            finally:
                sending.cancel()

    return routes


async def _send_changes(socket: WebSocket, console: Console, face: Face) -> None:
    sent: object = None
    with suppress(WebSocketDisconnect, RuntimeError):  # the face was closed
        async for _ in console.notifier.changes():
            data = face_data(console, face)
            shown = {**data, "seconds_left": None}
            if shown != sent:
                sent = shown
                await socket.send_json(data)


def face_data(console: Console, face: Face) -> dict[str, Any]:
    """Return what a face shows, such as what the robot says and asks, as data for JSON."""
    view, shown = console.view, face.shown
    question = shown.question
    is_moving = view.is_running and view.progress.is_driving
    doing = "asking" if question else "moving" if is_moving else "working" if view.is_running else "idle"
    return {
        "doing": doing,
        "to": screen_text(view.progress.room, MAX_FACE_OPTION) if is_moving else "",
        "said": [{"number": said.number, "text": screen_text(said.text)} for said in shown.said],
        "question": None if question is None else question_data(question),
        "seconds_left": None if question is None else _seconds_left(question),
        "ended": None if shown.ended is None else _ended_data(shown.ended),
        "screens": face.screens,
        "state": view.state,
        "is_over": view.is_over,
        "reason": UNCONFIRMED_STOP if console.warning else "",
    }


def _seconds_left(question: FaceQuestion) -> float | None:
    left = question.until - time.monotonic()
    return round(max(0.0, left), 1) if math.isfinite(left) else None


def question_data(question: FaceQuestion) -> dict[str, Any]:
    """Convert a question to data for JSON, with long strings shortened, and at most 50 options."""
    return {
        "number": question.number,
        "person": screen_text(question.person, MAX_FACE_OPTION),
        "text": screen_text(question.text),
        "options": [screen_text(option, MAX_FACE_OPTION) for option in question.options[:MAX_FACE_OPTIONS]],
        "more_options": max(0, len(question.options) - MAX_FACE_OPTIONS),
    }


def screen_text(text: str, most: int = MAX_FACE_TEXT) -> str:
    """Shorten a string to `most` characters, and escape hidden characters, but keep line breaks."""
    return shortened(text, most, visible_lines)


def _ended_data(ended: FaceQuestion) -> dict[str, Any]:
    answer = None if ended.answer is None else screen_text(ended.options[ended.answer], MAX_FACE_OPTION)
    return {"number": ended.number, "how": ended.how, "answer": answer}
