"""One mission's turn at the robot, on a thread of its own: written, checked, approved, run, stopped."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from codebotler.checking.problems import Check
from codebotler.core.errors import UserError
from codebotler.core.terminal import system_sentence, visible
from codebotler.generation.generate import generate
from codebotler.missions.log import Line
from codebotler.missions.mission import STEPS, Mission, MissionError, State
from codebotler.missions.preflight import beyond, preflight, unknown_rooms
from codebotler.models.base import Model, ModelError
from codebotler.models.rate_limit import RateLimited
from codebotler.prompts import prompt_for
from codebotler.robots.base import NotReadyError, Robot
from codebotler.robots.reservation import Reservation
from codebotler.simulator.engine import EngineError
from codebotler.simulator.sampled_robot import RoomMap
from codebotler.web.view import Order, View, digest

LOG = logging.getLogger("codebotler.web")
EXPECTED = (UserError, ModelError, NotReadyError, EngineError, MissionError, OSError)


@dataclass(frozen=True)
class Means:
    """What turns have in common.

    Args:
        robot: not connected.
        home: the folder of missions.
        open_model: gives a model by its name.
        check: says what is wrong with a program, given the robot's rooms.
        changed: told that something has changed; back at once.
    """

    robot: Robot
    home: Path
    open_model: Callable[[str], Model]
    check: Callable[[str, RoomMap | None], Check]
    changed: Callable[[], None]


class Turn:
    """One mission from what is asked for to its end.

    Args:
        number: counted from 1.
        order: what is asked for.
        means: what all turns have in common.
        before: the turn whose end is waited for.
    """

    def __init__(self, number: int, order: Order, means: Means, before: Turn | None = None) -> None:
        self._means, self._before = means, before
        self._lock = threading.Condition()  # held for moments; never while a mission is asked for something
        self._paper = threading.Lock()  # held while a program is exchanged or approved
        self._view = View(number, order=order, program=order.program, busy="waiting", is_over=False)
        self._events: list[Line] = []
        self._mission: Mission | None = None
        self._wish: str | None = None
        self._again: tuple[Sequence[str], ...] = ()
        self._stopped_by: str | None = None
        self._asking: tuple[asyncio.AbstractEventLoop, asyncio.Task[str]] | None = None
        self._thread = threading.Thread(target=self._go, name=f"turn-{number}", daemon=True)

    def start(self) -> None:
        """Begin; back at once."""
        self._thread.start()

    def join(self, seconds: float | None = None) -> None:
        """Wait until nothing can happen any more."""
        self._thread.join(seconds)

    @property
    def view(self) -> View:
        """It as it stands; at once."""
        return self._view

    def events(self, start: int = 0) -> list[Line]:
        """The events of the mission, from one on; at once.

        Args:
            start: how many are known already.
        """
        return self._events[start:]

    def edit(self, program: str) -> None:
        """Take another program, and check it; back at once, also where the check takes its time.

        Raises:
            MissionError: it is too late for that, or a model is writing one.
        """
        with self._paper, self._lock:
            if self._view.is_over or not self._view.may_be_edited:
                raise MissionError("the program cannot be changed now")
            self._wish = program
            changed = {"found": None, "problems": (), "unknown": ()}
            self._change(program=program, author="", busy="checking", **changed)
            self._lock.notify_all()

    def ask_again(self, *, repair: bool) -> None:
        """Have the model write another program; back at once.

        Args:
            repair: whether it is told the program and its problems.

        Raises:
            MissionError: no model wrote it, or it is too late for that.
        """
        with self._lock:
            view = self._view
            if not view.may_be_approved or not view.order.model:
                raise MissionError("nobody can be asked again now")
            self._again = (view.problems if repair else (),)
            self._change(busy=f"asking {view.order.model}", is_written=True)
            self._lock.notify_all()

    def approve(self, named: str, *, despite_problems: bool = False) -> None:
        """Take somebody's word that a program may be run.

        Args:
            named: the digest of the program that they saw.
            despite_problems: whether they say so although there are problems.

        Raises:
            MissionError: the program is another one by now, was not checked, or has problems.
        """
        with self._paper:
            view, mission = self._view, self._mission
            if mission is None or view.busy:
                raise MissionError("the program is not checked yet")
            if named != view.digest or named != digest(mission.summary.program):
                raise MissionError("the program was changed since; look at it again")
            mission.approve(despite_problems=despite_problems)

    def stop(self, by: str) -> None:
        """Stop it, whatever goes on; back when the robot was told so.

        Args:
            by: who wants it, in words.
        """
        self._stopped_by = self._stopped_by or by
        mission, asking = self._mission, self._asking
        try:
            if mission is not None:
                with suppress(MissionError):  # it ended by itself
                    mission.stop(by)
        finally:
            if asking is not None:
                with suppress(RuntimeError):  # the answer is there
                    asking[0].call_soon_threadsafe(asking[1].cancel)
            with self._lock:
                self._lock.notify_all()

    def _is_unwanted(self) -> bool:
        return self._stopped_by is not None

    # --- on its own thread

    def _go(self) -> None:
        try:
            if self._before is not None:
                self._before.join()
                self._before = None
            self._show(busy="connecting the robot")
            self._through()
        except EXPECTED as error:
            self._show(trouble=_sentence(error))
        except Exception as error:
            LOG.exception("a mission broke off")
            self._show(trouble=f"{type(error).__name__}: {visible(str(error))}")
        finally:
            self._show(is_over=True, busy="", is_written=False)

    def _through(self) -> None:
        robot, home, order = self._means.robot, self._means.home, self._view.order
        if self._is_unwanted():
            return
        with (
            Reservation(robot, home) as reserved,
            Mission(home, robot.name, order.instruction, told=self._told) as mission,
        ):
            self._mission = mission
            self._show(id=mission.id, state=mission.state)
            if self._is_unwanted():
                return  # and that stops it
            plan, place = preflight(robot)
            self._show(plan=plan)
            if order.program:
                self._take(mission, order.program)
            else:
                self._ask(mission, ())
            while mission.state in {State.DRAFTING, State.CHECKED}:
                self._obey(mission)
            if mission.state is State.APPROVED:
                with suppress(MissionError):  # it was stopped before it could run
                    mission.run(reserved, place)

    def _obey(self, mission: Mission) -> None:
        """Wait for what somebody wants next, and do it."""
        with self._lock:
            while self._wish is None and not self._again and mission.state is State.CHECKED:
                self._lock.wait()
            wish, again = self._wish, self._again
            self._again = ()
        if mission.state not in {State.DRAFTING, State.CHECKED}:
            return
        if again:
            self._ask(mission, again[0])
        elif wish is not None:
            self._take(mission, wish)

    def _ask(self, mission: Mission, problems: Sequence[str]) -> None:
        """Have the model write a program, and take it."""
        order, before = self._view.order, self._view
        self._show(
            busy=f"asking {order.model}", is_written=True, program="", found=None, problems=(), trouble=""
        )
        try:
            model = self._means.open_model(order.model)
            program = asyncio.run(self._reply(model, before.program, problems))
        except asyncio.CancelledError:
            if before.program:
                self._restore(before)
            return
        except (UserError, ModelError) as error:
            if not before.program:
                raise
            self._restore(before)
            self._show(trouble=visible(str(error)))
            return
        self._show(is_written=False, author=model.name)
        self._take(mission, program)

    def _restore(self, before: View) -> None:
        """Show the program of before: nobody wrote another one."""
        kept = ("program", "author", "found", "problems", "unknown")
        self._show(**{name: getattr(before, name) for name in kept}, busy="", is_written=False)

    async def _reply(self, model: Model, before: str, problems: Sequence[str]) -> str:
        plan, order = self._view.plan, self._view.order
        prompt = prompt_for(order.instruction, rooms=() if plan is None else plan.rooms)
        if problems:
            prompt = prompt.after(before, problems)

        async def ask() -> str:
            try:
                made = await generate(RateLimited(model, concurrency=1), prompt, heard=self._heard)
            finally:
                await model.close()
            return made.program

        task = asyncio.create_task(ask())
        self._asking = (asyncio.get_running_loop(), task)
        try:
            if self._is_unwanted():
                task.cancel()
            return await task
        finally:
            self._asking = None

    def _heard(self, piece: str) -> None:
        with self._lock:
            self._change(program=self._view.program + piece)

    def _take(self, mission: Mission, program: str) -> None:
        """Make a program the mission's, and check it."""
        with self._paper, self._lock:
            if self._wish not in {None, program}:
                return  # somebody wants another one by now
            self._wish = None
            self._change(program=program, busy="checking", found=None, problems=(), unknown=(), trouble="")
            author = self._view.author
        try:
            mission.draft(program, author)
            found = self._means.check(program, self._view.plan)
            lacking = beyond(program, self._means.robot)
            problems = (*(problem.sentence for problem in found.problems), *lacking)
            plan = self._view.plan
            unknown = unknown_rooms(program, plan) if plan and not found.problems else []
            mission.check(problems)
        except MissionError:
            if not mission.has_ended:
                raise
            return
        for sentence in (*lacking, *unknown):
            mission.note(f"before it moves: {sentence}")
        with self._lock:
            if self._wish is None:
                self._change(found=found, problems=problems, unknown=tuple(unknown), busy="")

    # --- what viewers see

    def _told(self, line: Line) -> None:
        """Take an event of the mission; called with its book held, and back at once."""
        with self._lock:
            self._events.append(line)
            view = self._view
            changes: dict[str, object] = {"progress": view.progress.after(line, view.program)}
            if line["event"] == "state":
                changes |= {"state": State(line["state"]), "reason": line.get("reason", "")}
                if line["state"] not in STEPS:
                    changes["busy"] = ""
            self._change(**changes)
            self._lock.notify_all()

    def _show(self, **changes: object) -> None:
        with self._lock:
            self._change(**changes)

    def _change(self, **changes: object) -> None:
        """Change what viewers see; the caller has the lock."""
        self._view = replace(self._view, **changes)  # type: ignore[arg-type]  # names and values of its fields
        self._means.changed()


def _sentence(error: Exception) -> str:
    if isinstance(error, OSError) and error.filename is not None:
        return system_sentence(error)
    return visible(str(error))
