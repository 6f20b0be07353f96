"""The operator's console: the robot and the mission at hand, the same for every viewer."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncGenerator, Callable, Sequence
from contextlib import ExitStack, aclosing, suppress
from dataclasses import replace
from pathlib import Path
from typing import Self

from codebotler.checking.check import check
from codebotler.checking.problems import CheckResult
from codebotler.core.errors import UserError
from codebotler.core.files import make_folder
from codebotler.core.world import World
from codebotler.missions.log import Summary
from codebotler.missions.mission import GRACE, SHUTTING_DOWN, MissionError
from codebotler.missions.session import MissionSession
from codebotler.missions.store import recover
from codebotler.missions.view import Order, SessionView
from codebotler.models.base import Model
from codebotler.robots.base import Robot
from codebotler.robots.face import Face
from codebotler.simulator.house_rule import Rule
from codebotler.simulator.pool import WorkerPool
from codebotler.simulator.sampled_robot import RoomMap

MOST_PROGRAM = 200_000
"""The longest program or instruction, in characters."""

QUIET = 15.0
"""Seconds after which somebody who waits for something gets an answer in any case."""


class Console:
    """Holds a robot, connected by missions only, and the mission at hand, for viewers on any threads.

    `models` are the names on offer, the default first.
    """

    def __init__(
        self,
        robot: Robot,
        home: Path,
        open_model: Callable[[str], Model],
        *,
        models: Sequence[str] = ("recorded:careful", "recorded:hasty"),
        world: World | None = None,
        face: Face | None = None,
        rules: tuple[Rule, ...] = (),
    ) -> None:
        self.robot, self.home, self.models, self.world = robot, home, tuple(models), world
        self.notifier, self.face, self.rules = Notifier(), face, rules
        if face is not None:
            face.changed = self.notifier.change
        self.interrupted: tuple[Summary, ...] = ()
        self._open_model = open_model
        self._lock = threading.Lock()  # held for moments
        self._session: MissionSession | None = None
        self._checking = threading.Lock()
        self._held = ExitStack()
        self._pool: WorkerPool | None = None

    def __enter__(self) -> Self:
        self.interrupted = tuple(recover(self.home))
        make_folder(self.home / "missions")
        return self

    def __exit__(self, *_: object) -> None:
        session = self._session
        if session is not None:
            session.stop(SHUTTING_DOWN)
            session.join(GRACE + 1)
        with self._checking:
            self._held.close()

    @property
    def session(self) -> MissionSession | None:
        """The mission at hand, or the last one."""
        return self._session

    @property
    def view(self) -> SessionView:
        """What all viewers see."""
        session = self._session
        return SessionView() if session is None else session.view

    async def view_once(self, *, over: bool) -> SessionView:
        """What all viewers see once a mission is over, or goes on; at the latest after some seconds."""
        await self.notifier.until(lambda: self.view.is_over == over, QUIET)
        return self.view

    def begin(self, order: Order) -> MissionSession:
        """Begin a mission, by default with the first model.

        One at hand that is not running makes room for it; another one raises MissionError.
        """
        model = order.model.strip() or ("" if order.has_program else self.models[0])
        order = replace(order, instruction=order.instruction.strip(), model=model)
        for text in (order.instruction, order.program):
            _check_length(text)
        with self._lock:
            before = self._session
            if before is not None and before.view.is_running:
                raise MissionError(f"mission {before.view.id} is {before.view.state}; stop it first")
            self._session = session = MissionSession(
                self.robot,
                self.home,
                order,
                open_model=self._open_model,
                check=self.check,
                rules=self.rules,
                changed=self.notifier.change,
                number=before.view.number + 1 if before else 1,
                before=before,
                world=self.world,
            )
        if before is not None:
            before.stop_soon("another instruction")
        session.start()
        self.notifier.change()
        return session

    def edit(self, program: str) -> MissionSession:
        """Replace the program at hand; after the end of a mission this begins another one."""
        _check_length(program)
        session = self._session
        if session is None or session.view.is_over:
            before = self.view
            if program == before.program:
                return self.begin(Order(before.instruction, before.model, program, before.author))
            kept = before.instruction if is_version_of(before.program, program) else ""
            return self.begin(Order(kept, before.model if kept else "", program))
        session.edit(program)
        return session

    def dismiss(self) -> None:
        """Dismiss the notice about interrupted missions."""
        self.interrupted = ()
        self.notifier.change()

    def stop(self, by: str, *, only_moving: bool = False) -> bool:
        """Stop the mission, or only a robot that runs, without waiting; whether there is anything to stop."""
        session, view = self._session, self.view
        if session is None or view.is_over or (only_moving and not view.is_running):
            return False
        session.stop_soon(by)
        return True

    def check(
        self, program: str, room_map: RoomMap | None = None, rules: tuple[Rule, ...] = ()
    ) -> CheckResult:
        """Check a program, one at a time; without a map of the robot's rooms they are taken from it."""
        with self._checking:
            if self._pool is None:
                self._pool = self._held.enter_context(WorkerPool(1))
            table = self.robot.skills
            return check(program, room_map=room_map, pool=self._pool, house_rules=rules, skills=table)


class Notifier:
    """Wakes viewers at each change; they then read what there is, so no queue can grow."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._wakes: list[Callable[[], None]] = []

    def change(self) -> None:
        """Wake all viewers; from any thread."""
        with self._lock:
            wakes = tuple(self._wakes)
        for wake in wakes:
            wake()

    async def changes(self) -> AsyncGenerator[None]:
        """Yield now, and again after changes; those during one round of the loop count as one."""
        loop, changed = asyncio.get_running_loop(), asyncio.Event()

        def wake() -> None:
            with suppress(RuntimeError):  # the loop has ended, and with it all who waited
                loop.call_soon_threadsafe(changed.set)

        with self._lock:
            self._wakes.append(wake)
        try:
            while True:
                changed.clear()
                yield
                await changed.wait()
        finally:
            with self._lock:
                self._wakes.remove(wake)

    async def until(self, holds: Callable[[], bool], seconds: float | None = None) -> bool:
        """Wait until something holds, at most so many seconds; whether it does."""
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds), aclosing(self.changes()) as changes:
                async for _ in changes:
                    if holds():
                        return True
        return holds()


def is_version_of(program: str, changed: str) -> bool:
    """Whether a program, changed by hand, is still for the same instruction: it keeps half of the lines."""
    lines = [line for line in map(str.strip, program.splitlines()) if line]
    kept = set(map(str.strip, changed.splitlines()))
    return bool(lines) and 2 * sum(line in kept for line in lines) >= len(lines)


def _check_length(text: str) -> None:
    if len(text) > MOST_PROGRAM:
        raise UserError(f"it is too long: {len(text):,} characters, and {MOST_PROGRAM:,} is the limit")
