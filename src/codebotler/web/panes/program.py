"""The program pane: editor, problems, approval and storyboard."""

from __future__ import annotations

import asyncio
import json
import re
import time
from collections.abc import Sequence
from functools import partial
from itertools import islice
from typing import Any

from nicegui import ui
from nicegui.events import GenericEventArguments

from codebotler.checking.problems import CheckResult
from codebotler.core.skills.declaration import by_name
from codebotler.core.terminal import shortened, visible
from codebotler.missions.display.view import SessionView
from codebotler.missions.display.wording import BY_PAGE
from codebotler.missions.storage.log import MissionState
from codebotler.models.recorded import is_recorded
from codebotler.web.console import MAX_PROGRAM_CHARACTERS, Console
from codebotler.web.frame import Button, DrawnBox, PlainText, script, scroll_up, warn, warned
from codebotler.web.panes.candidates import CandidatesPane
from codebotler.web.panes.continuing import (
    EARLY_ENDS,
    draw_past,
    is_unfinished,
    origin_text,
    storyboard_title,
)
from codebotler.web.panes.contract import draw_contract
from codebotler.web.panes.reply import ReplyPane
from codebotler.web.panes.rules import RulesPane
from codebotler.web.storyboard import Storyboard, draw_strips

_CALL = re.compile(r"\b([^\W\d]\w*)(?=\s*\()")
_MAX_MARKS, _MAX_ESCAPES = 400, 2_000
_MAX_PROBLEMS = 20
REVIEW_SECONDS = 1.5
"""After a program replaces another one, a click within this time may be meant for the old program."""


class ProgramPane:
    """Shows the current program, and lets an operator edit and approve it."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._received = 0  # the number of the last text received from this browser
        self._sent: dict[str, object] = {}
        script("editor.js")
        ui.on("program-typed", self._typed)
        with ui.element("section").classes("pane program").props("aria-labelledby=h-program"):
            with ui.element("div").classes("head"):
                PlainText("h2", "Program").props("id=h-program")
                self._busy = PlainText("span", "", "busy").props("role=status")
            self._origin = PlainText("p", "", "quiet origin")
            self._reply = ReplyPane()
            self._candidates = CandidatesPane(console)
            self._writer = PlainText("p", "", "quiet")
            # Only the script changes the editor: updating a property would overwrite text being typed.
            self._editor = ui.codemirror("", language="Python", line_wrapping=False).classes("editor")
            self._editor.on("update:value", js_handler="() => programEditor.typed()")
            self._verdict = PlainText("p", "", "verdict").props("role=status")
            self._problems = DrawnBox("problems", _draw_problems, "ul")
            self._contract = DrawnBox("contract", partial(draw_contract, console.robot.skills))
            self._rules = RulesPane(console)
            self._instruction = PlainText("p", "")
            self._approval = ui.element("div").classes("word")
            with self._approval:
                self._despite = ui.checkbox("Run it despite the problems", on_change=self._ticked)
                self._run = Button("Run it on the robot", self._approve, "go", emits="programEditor.settle()")
                self._raise = Button("", self._raise_limit, "plain")
                self._repair = Button("Repair", lambda: self._again(repair=True), "plain")
                self._again_button = Button("Ask again", lambda: self._again(repair=False), "plain")
            self._past = DrawnBox("done-before", draw_past)
            self._board = DrawnBox("storyboard", draw_strips)
        self._view = console.view
        self._shown = self._typed_here = (console.view.number, console.view.program)
        self._review_until = 0.0
        ui.run_javascript(f"programEditor.start({self._editor.id})")

    def show(self, view: SessionView) -> None:
        """Show the mission's program with its problems, and the buttons that make sense now."""
        current = view.number, view.program
        if view.program and current != self._shown:
            if self._shown[1] and current != self._typed_here:  # a click may be meant for the one before
                self._review_until = time.monotonic() + REVIEW_SECONDS
                self._despite.value = False
                ui.timer(REVIEW_SECONDS, self._ticked, once=True)
            self._shown = current
        self._view = view
        shown = _for_editor(view.arriving.code if view.is_written else view.program)
        self._send(view, shown)
        self._origin.show_text(origin_text(view))
        self._past.show(view.past)
        self._reply.show(view)
        self._candidates.show(view)
        self._editor.set_visibility(not view.waits_for_answer)
        self._busy.show_text(f"{view.busy} …" if view.busy and not view.is_over else "")
        self._writer.show_text(_author_text(view) if view.program and not view.is_written else "")
        self._show_verdict(view)
        self._instruction.show_text(_instruction_text(view) if view.program else "")
        self._contract.show(None if view.contract is None else (view.contract, view.earlier))
        self._rules.show(view)
        self._show_approval(view)
        self._problems.show((view.problems, view.unknown_rooms))
        self._board.show(None if view.check is None else storyboard_of(view, view.check))

    def _send(self, view: SessionView, shown: str, *, force: bool = False) -> None:
        """Send a program and its marks to the browser, which keeps its own text if that is newer."""
        content: dict[str, object] = {
            "program": shown,
            "marks": [
                *_skill_marks(shown),
                *_escape_marks(shown),
                *_problem_marks(view.check, shown),
                *_current_line(view),
            ],
            "editable": view.may_be_edited,
            "received": self._received,
            "approval": self._approves(view),
            "replaced": self._review_until,
            "force": force,
        }
        if content != self._sent or force:
            self._sent = content
            ui.run_javascript(f"programEditor.show({json.dumps(content)})")

    def _typed(self, event: GenericEventArguments) -> None:
        """Check typed text, unless another person changed the program first."""
        typed, self._received = event.args["text"], int(event.args["number"])
        current = _for_editor(self._console.view.program)
        if typed is None:
            self._restore(
                f"The limit is {MAX_PROGRAM_CHARACTERS:,} characters; your last edit was discarded."
            )
        elif event.args["base"] != current:
            self._restore("Someone else changed the program; your last edit was discarded.")
        elif typed != current:
            with warned():
                self._typed_here = self._console.edit(typed).view.number, typed
        self.show(self._console.view)

    def _restore(self, why: str) -> None:
        """Show the console's program again, with a warning."""
        view = self._console.view
        self._send(view, _for_editor(view.program), force=True)
        warn(why, 10.0)

    # --- the approval

    def _show_verdict(self, view: SessionView) -> None:
        count = len(view.problems)
        if view.check is None:
            self._verdict.show_text("")
            return
        many = f"{count} problems" if count > 1 else "1 problem"
        self._verdict.classes(add="bad" if count else "good", remove="good" if count else "bad")
        verdict = f"{many}. The robot should not run this." if count else "Checked: no problems."
        verdict += f" But {view.check.vain_runs}." if view.check.vain_runs and not count else ""
        if view.check.rooms_are_guessed:
            verdict += " The robot does not list its rooms; the check used the rooms named in the program."
        self._verdict.show_text(f"{verdict} {view.check.assumption}".rstrip())

    def _show_approval(self, view: SessionView) -> None:
        open_ = view.state is not None and view.state.is_open and not view.is_over and bool(view.program)
        may_again, none = view.may_be_asked_again, view.programless
        self._approval.set_visibility(open_ or may_again or self._may_rerun(view))
        self._despite.set_visibility(open_ and bool(view.problems) and view.can_run)
        if not view.problems:
            self._despite.value = False
        can_repair = view.waits_for_program and none is not None and none.can_repair
        self._repair.text = "Ask for the program only" if can_repair else "Repair"
        self._repair.set_visibility(may_again and (bool(view.problems) or can_repair))
        self._again_button.set_visibility(may_again)
        higher = none.higher_limit if none is not None and may_again else None
        self._raise.show_text(f"Raise the limit to {higher:,} tokens" if higher else "")
        self._run.set_visibility(open_ or self._may_rerun(view))
        again = "Prepare another run" if view.past is None else "Check this rest again"
        again = "Start again from the beginning" if is_unfinished(view) else again
        self._run.text = again if self._may_rerun(view) else "Run it on the robot"
        self._ticked()

    def _may_rerun(self, view: SessionView) -> bool:
        is_rest = view.past is not None and view.progress.has_begun  # alone, it would leave out what was done
        return view.is_over and bool(view.program) and not is_rest

    def _ticked(self) -> None:
        view = self._console.view
        accepted = not view.problems or (bool(self._despite.value) and view.can_run)
        is_new = time.monotonic() < self._review_until
        self._run.allow(self._may_rerun(view) or (view.may_be_approved and accepted and not is_new))
        look = "plain" if is_unfinished(view) else "go risky" if view.problems else "go"
        self._run.classes(add=look, remove="plain go risky")

    def _approves(self, view: SessionView) -> list[object]:
        """Return what a click on a page that shows this view approves, after the presses of STOP so far."""
        return [self._console.presses, view.number, view.digest, *view.disabled_rules]

    async def _approve(self, seen: dict[str, Any]) -> None:
        """Approve the program that the browser showed at the click, which may come late, or refuse."""
        session, view, presses = self._console.session, self._view, self._console.presses
        program, is_reviewed = _for_editor(view.program), seen["age"] >= 1000 * REVIEW_SECONDS
        if seen["approval"][0] != presses:
            self._restore("Somebody pressed STOP; look at the program again.")
        elif self._may_rerun(view):
            self._console.edit(view.program)
        elif session and is_reviewed and (seen["text"], seen["approval"]) == (program, self._approves(view)):
            despite, rules = bool(self._despite.value), view.disabled_rules
            await asyncio.to_thread(
                session.approve, view.digest, despite_problems=despite, disabled_rules=rules
            )
            if self._console.presses != presses:
                session.stop_soon(BY_PAGE)
            scroll_up()
        elif is_reviewed and seen["text"] == program:
            ui.notify("Checking your last edit first.", position="bottom")
        else:
            self._restore("The program has changed; review it again.")

    def _again(self, *, repair: bool, max_tokens: int | None = None) -> None:
        session = self._console.session
        if session is not None:
            session.ask_again(repair=repair, max_tokens=max_tokens)

    def _raise_limit(self) -> None:
        none = self._console.view.programless
        if none is not None:
            self._again(repair=False, max_tokens=none.higher_limit)


def _draw_problems(found: tuple[Sequence[str], Sequence[str]]) -> None:
    problems, unknown_rooms = found
    for sentence in (*problems, *unknown_rooms)[:_MAX_PROBLEMS]:
        PlainText("li", shortened(sentence), "problem" if sentence in problems else "unsure")


def storyboard_of(view: SessionView, check: CheckResult) -> Storyboard:
    """Return what the check expects, and how far the robot has come, with rooms named as in the check."""
    room_map = view.room_map or check.room_map
    visited = tuple(room_map.room(words) or words for words in view.progress.visited)
    end = ""
    if view.is_over and view.state in EARLY_ENDS:
        end = "failed" if view.state is MissionState.FAILED else "stopped"
    return Storyboard(check, storyboard_title(view), visited, view.progress.learned, end)


def _author_text(view: SessionView) -> str:
    if not view.author:
        return "Typed or edited by hand."
    if is_recorded(view.author):
        return "A recorded program, not written by a language model."
    return f"Written by {view.author}."


def _instruction_text(view: SessionView) -> str:
    if view.instruction:
        return f"Instruction: {shortened(view.instruction, 400)}"
    return "Your own program, without an instruction."


def _for_editor(program: str) -> str:
    """Convert a program for the editor, which supports neither CRLF nor lone surrogates."""
    return re.sub("\r\n?", "\n", program).encode(errors="replace").decode()


def _skill_marks(program: str) -> list[dict[str, Any]]:
    calls = (match for match in _CALL.finditer(program) if by_name(match[1]) is not None)
    found = islice(calls, _MAX_MARKS)
    return [{"kind": "mark", "from": m.start(), "to": m.end(), "class": "skill"} for m in found]


def _escape_marks(program: str) -> list[dict[str, Any]]:
    """Return marks that escape characters that are invisible or change the direction of text."""
    hidden = ((at, one) for at, one in enumerate(program) if not (one.isprintable() or one in "\t\n"))
    marks: list[dict[str, Any]] = []
    for at, one in islice(hidden, _MAX_ESCAPES):
        marks.append({"kind": "widget", "position": at, "text": visible(one), "class": "escape"})
        marks.append({"kind": "mark", "from": at, "to": at + 1, "class": "escaped"})
    return marks


def _current_line(view: SessionView) -> list[dict[str, Any]]:
    line = view.progress.line if view.is_running else view.line
    kind = "running-line" if view.is_running else "failed-line"
    is_there = line is not None and line <= view.program.count("\n") + 1
    return [{"kind": "line", "line": line, "class": kind}] if is_there else []


def _problem_marks(found: CheckResult | None, program: str) -> list[dict[str, Any]]:
    if found is None:
        return []
    lines = program.split("\n")
    marks: list[dict[str, Any]] = []
    for problem in found.problems[:_MAX_PROBLEMS]:
        if problem.line is None or problem.line > len(lines):
            continue
        end = sum(len(line) + 1 for line in lines[: problem.line]) - 1
        marks.append({"kind": "line", "line": problem.line, "class": "problem-line"})
        words = shortened(problem.message, 160)
        marks.append({"kind": "widget", "position": end, "text": words, "class": "problem-words"})
    return marks
