"""The operator's console: the robot, the mission at hand and those before, the same for every viewer."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Self

from codebotler.checking.check import check
from codebotler.checking.problems import Check
from codebotler.core.home import make_folder
from codebotler.core.world import World
from codebotler.missions.log import Line, Summary
from codebotler.missions.mission import GRACE, MissionError
from codebotler.missions.session import MissionSession, Order, SessionView
from codebotler.missions.store import recover
from codebotler.models.base import Model
from codebotler.robots.base import Robot
from codebotler.robots.face import Face
from codebotler.simulator.engine import WorkerPool
from codebotler.simulator.sampled_robot import RoomMap
from codebotler.web.notifier import Notifier

MOST_PROGRAM = 200_000
"""Characters of a program or an instruction; longer ones are mistakes."""

NOTHING = SessionView()


class Console:
    """Holds a robot and the mission at hand; as a context manager, from the start of the tool to its end.

    All methods are for any thread. Those that say so are back at once, the others may wait for a disk or for
    a robot.

    Args:
        robot: not connected; it is, while a mission has it.
        home: the folder of missions.
        open_model: gives a model by its name.
        models: the names that are offered, the first one by default.
        world: where the robot is, if somebody has measured it.
        face: on which the robot speaks, if it does.
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
    ) -> None:
        self.robot, self.home, self.models, self.world = robot, home, tuple(models), world
        self.notifier, self.face = Notifier(), face
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
            if not session.view.is_over:
                session.stop("the end of the tool")
            session.join(GRACE + 1)
        with self._checking:
            self._held.close()

    @property
    def session(self) -> MissionSession | None:
        """The mission at hand, or the last one; at once."""
        return self._session

    @property
    def view(self) -> SessionView:
        """What all viewers see; at once."""
        session = self._session
        return NOTHING if session is None else session.view

    def events(self, start: int = 0) -> list[Line]:
        """The events of the mission at hand, from one on; at once."""
        session = self._session
        return [] if session is None else session.events(start)

    def begin(self, order: Order) -> MissionSession:
        """Begin a mission; one that is not running yet makes room for it. Back at once.

        Raises:
            MissionError: the robot is on another one, or the order cannot be carried out.
        """
        order = Order(order.instruction.strip(), order.model.strip(), order.program)
        if not order.program.strip() and not (order.instruction and order.model):
            raise MissionError("nothing is asked for; say what the robot is to do")
        for text in (order.instruction, order.program):
            _expect_short(text)
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
                changed=self.notifier.change,
                number=before.view.number + 1 if before else 1,
                before=before,
            )
        if before is not None and not before.view.is_over:
            threading.Thread(target=before.stop, args=("another instruction",), daemon=True).start()
        session.start()
        self.notifier.change()
        return session

    def edit(self, program: str) -> MissionSession:
        """Put another program in the place of the one at hand; after its end this begins a mission.

        Back at once.

        Raises:
            MissionError: the robot runs, or a model is writing.
        """
        _expect_short(program)
        session = self._session
        if session is None or session.view.is_over:
            return self.begin(Order(self.view.order.instruction, program=program))
        session.edit(program)
        return session

    def stop(self, by: str) -> bool:
        """Stop the mission at hand; back when the robot was told so.

        Args:
            by: who wants it, in words.

        Returns:
            whether there was one.
        """
        session = self._session
        if session is None or session.view.is_over:
            return False
        session.stop(by)
        return True

    def stop_soon(self, by: str, *, only_moving: bool = False) -> bool:
        """Have the mission at hand stopped by a thread of its own, so that nothing slow delays it; at once.

        Args:
            by: who wants it, in words.
            only_moving: whether a mission whose robot does not run goes on.

        Returns:
            whether there is anything to stop.
        """
        view = self.view
        if view.is_over or (only_moving and not view.is_running):
            return False
        threading.Thread(target=self.stop, args=(by,), daemon=True).start()
        return True

    def check(self, program: str, plan: RoomMap | None = None) -> Check:
        """Say what is wrong with a program, one after the other.

        Args:
            program: its source.
            plan: the robot's rooms; without them they are taken from the program.

        Raises:
            EngineError: no isolated process could be started.
        """
        with self._checking:
            if self._pool is None:
                self._pool = self._held.enter_context(WorkerPool(1))
            return check(program, plan=plan, pool=self._pool)


def _expect_short(text: str) -> None:
    if len(text) > MOST_PROGRAM:
        raise MissionError(f"{len(text):,} characters are too many; at most {MOST_PROGRAM:,} are taken")
