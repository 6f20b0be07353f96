"""The state machine of a mission: drafted, checked, approved and run, with a stop at any time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from datetime import datetime
from itertools import chain, count
from pathlib import Path
from types import TracebackType
from typing import Self, TypeAlias

from codebotler.checking.contracts.file import contract_data
from codebotler.core.files import Appender, make_folder
from codebotler.core.terminal import visible
from codebotler.core.text.words import with_sentence
from codebotler.core.trace import Outcome, RunError, Status, Trace
from codebotler.core.world import World
from codebotler.missions.display.wording import stop_text
from codebotler.missions.live import LiveRobot, StoppedError
from codebotler.missions.stop import StopButton
from codebotler.missions.storage.log import (
    NEXT_STATES,
    LogLine,
    MissionState,
    MissionSummary,
    add_event,
    open_log,
)
from codebotler.missions.storage.map_event import map_data
from codebotler.missions.storage.past import MissionPast
from codebotler.missions.storage.pictures import PictureStore
from codebotler.robots.base import RobotLostError
from codebotler.robots.reservation import Reservation, normalize_address
from codebotler.simulator.guard.contract import Contract
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.guard.rule_guard import RuleGuard
from codebotler.simulator.worker import EngineError, Worker
from codebotler.simulator.worlds.room_map import NO_ROOMS, RoomMap

STOP_GRACE_SECONDS = 10.0
"""The time that a robot has to confirm a stop, in real seconds."""

BY_SHUTDOWN = "CodeBotler, shutting down"
"""The source of the stop in the log if CodeBotler exits during a mission."""

UNCONFIRMED_STOP = (
    "the robot has not confirmed the stop; check it now, and press its emergency stop if it still moves"
)


class MissionError(Exception):
    """Raised if a mission's state does not allow the requested action."""

    @property
    def sentence(self) -> str:
        """The error message."""
        return str(self)


EventListener: TypeAlias = Callable[[LogLine], None]
"""A function that receives each logged event. Calls may come from any thread, but never overlap."""

Driver: TypeAlias = Callable[[LiveRobot], Outcome]
"""A function that calls skills in place of a program, on the mission's thread, and returns the outcome."""


class Mission:
    """A mission with its folder and log, used as a context manager. Leaving the block ends the mission.

    Args:
        home: the folder that contains the `missions` folder.
        robot: the kind of robot, such as `simulated`.
        instruction: the instruction in plain words, or "" if there is none.
        on_event: a function that receives each logged event.
        stop_button: the button that stops the mission and its robot, by default a new one.

    Raises:
        OSError: the folder of the mission cannot be written.
    """

    def __init__(
        self,
        home: Path,
        robot: str,
        instruction: str = "",
        on_event: EventListener = lambda _: None,
        stop_button: StopButton | None = None,
    ) -> None:
        self.folder = _make_mission_folder(home / "missions")
        self._log: Appender | None = open_log(self.folder)
        self._pictures = PictureStore(self.folder)
        self.on_event = on_event
        self.stop_button = stop_button or StopButton()
        self._writing = threading.RLock()  # held while writing an event, but not while cancelling the robot
        self._has_program = False  # also true for an empty program
        self._live: LiveRobot | None = None
        self.stuck: threading.Thread | None = None  # runs a skill that has not returned since a stop
        self.may_move = False  # whether the robot was lost, or did not confirm a stop
        self._logged_rule: dict[str, object] = {}
        self._is_over = threading.Event()
        self._fault: Exception | None = None
        self.trace: Trace = ()
        name, now = self.folder.name, time.time()
        self.summary = MissionSummary(name, MissionState.DRAFTING, robot, now, instruction)
        self._write("state", state=MissionState.DRAFTING)
        self.stop_button.on_press(self._log_stop)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._log_stop()  # the thread that pressed STOP may not have logged the stop yet
            if not self.has_ended:
                self._leave(error)
        finally:
            self._close()

    @property
    def id(self) -> str:
        """The ID of the mission, which is also the name of its folder."""
        return self.summary.id

    @property
    def state(self) -> MissionState:
        """The current state of the mission."""
        return self.summary.state

    @property
    def is_approved(self) -> bool:
        """Whether the program is approved or runs, also while this is still being logged."""
        return self.state is MissionState.APPROVED or self.state.is_moving

    @property
    def has_ended(self) -> bool:
        """Whether the mission has reached a final state."""
        return self.summary.has_ended

    def set_program(self, program: str, model: str = "") -> None:
        """Set the program and the `model` that wrote it, if any. Raise MissionError after an approval."""
        with self._writing:
            self._step(
                MissionState.DRAFTING, "take another program", program=program, model=model, problems=()
            )
            self._has_program = True

    def record_check(self, problems: Sequence[str]) -> None:
        """Record the problems that a check found, in sentences. Raise MissionError if there is no program."""
        with self._writing:
            if not self._has_program:
                raise MissionError(f"mission {self.id} has no program to check; set a program first")
            self._step(MissionState.CHECKED, "be checked", problems=tuple(problems))

    def approve(self, *, despite_problems: bool = False, by: str = "") -> None:
        """Approve the program. Raise MissionError if it is unchecked, or has problems that are not accepted.

        `by` says in the log who approved, or is "" if the approval comes from the page or the terminal.
        """
        with self._writing:
            if self.state is MissionState.CHECKED and self.summary.problems and not despite_problems:
                mend = "approve it despite them, or change it"
                raise MissionError(f"the program of mission {self.id} has problems; {mend}")
            self._step(MissionState.APPROVED, "be approved")
            if by:
                self.note(f"approved by {by}")

    def fail(self, reason: str) -> None:
        """Mark the mission as failed and log why. Raise MissionError while it is running or after its end."""
        with self._writing:
            if self.state.is_moving:
                raise MissionError(f"mission {self.id} is {self.state} and cannot be marked failed; stop it")
            self._step(MissionState.FAILED, "fail", reason=reason)

    def extend_instruction(self, sentence: str) -> None:
        """Add a person's sentence to the instruction and to the log."""
        with self._writing:
            self.note(f"a person added to the instruction: {visible(sentence)}")
            self.summary.instruction = with_sentence(self.summary.instruction, sentence)

    def note(self, text: str) -> None:
        """Add a sentence to the log."""
        self._write("log", text=text)

    def log_map(self, world: World) -> None:
        """Add the rooms of a world to the log, as a `map` event."""
        self._write("map", **map_data(world))

    def stop(self, by: str = "somebody") -> None:
        """Stop the robot and the program, from any thread. `run` returns once both have stopped.

        Args:
            by: the source of the stop for the log, such as `Ctrl-C`.

        Raises:
            MissionError: the mission had already ended, so there is nothing to stop.
        """
        had_ended = self.has_ended
        self.stop_button.press(by)
        if had_ended or self.state not in {MissionState.STOPPING, MissionState.STOPPED}:
            raise MissionError(f"mission {self.id} is {self.state}; there is nothing to stop")

    def continue_from(self, past: MissionPast) -> None:
        """Record that this mission continues another, and log the earlier steps. Call this before `run`."""
        self.summary.continues = past.mission
        self.summary.write(self.folder)  # this process may be killed before the first program is checked
        self._write("past", **past.data())
        if past.testimony:
            self.note(past.testimony)

    def run(
        self,
        reserved: Reservation,
        place: str = "",
        *,
        rules: Sequence[Rule] = (),
        room_map: RoomMap | None = None,
        contracts: Sequence[Contract] = (),
        drive: Driver | None = None,
    ) -> MissionState:
        """Run the program on a robot, and return the final state: done, failed or stopped.

        The mission fails if the robot does not confirm a stop within `STOP_GRACE_SECONDS`.

        Args:
            reserved: the reservation of the robot.
            place: the robot's current room, or "" if unknown.
            rules: the house rules. Breaking one of them stops the mission.
            room_map: the rooms that the robot knows, or None if it does not list them.
            contracts: what the program may do. A call that goes beyond any of them stops the mission.
            drive: a function that calls the skills in place of the program.

        Raises:
            MissionError: the program is not approved.
            NotReadyError: the reservation is in use or has been used before.
            OSError: an event could not be logged or printed, so the robot was stopped.
        """
        guard = RuleGuard(rules, room_map or NO_ROOMS, contracts) if rules or contracts else None
        robot, button = reserved.robot, self.stop_button
        live = LiveRobot(robot, self._write, place=place, guard=guard, room_map=room_map, button=button)
        with self._writing:
            if self.state is MissionState.APPROVED:
                reserved.use()
                self._live, button.robot = live, robot
            will, address = robot.if_tool_dies, normalize_address(robot.address)
            self._step(MissionState.RUNNING, "run", if_tool_dies=will, place=place, address=address)
        if contracts:
            self._write("contract", contracts=[contract_data(contract) for contract in contracts])
        work = threading.Thread(target=self._execute, args=(live, drive), name=self.id, daemon=True)
        work.start()
        try:
            self.stop_button.ended.wait()
        except BaseException:
            with suppress(MissionError):
                self.stop(BY_SHUTDOWN)
            raise
        finally:
            if not self._is_over.wait(STOP_GRACE_SECONDS):
                self.stuck = work
                self._end(live, MissionState.FAILED, UNCONFIRMED_STOP, None, is_lost=True)
        if self._fault is not None:
            raise self._fault
        return self.state

    def _execute(self, live: LiveRobot, drive: Driver | None) -> None:
        """Run the program. This needs its own thread, because a skill may never return."""
        try:
            outcome = self._run_program(live) if drive is None else drive(live)
        except BaseException as error:  # noqa: BLE001 - any error must stop the robot
            try:
                if not isinstance(error, StoppedError):  # else a press has already stopped the robot
                    live.stop()
            finally:
                is_lost = isinstance(error, RobotLostError)
                self._end(live, MissionState.FAILED, _reason(error), None, is_lost=is_lost)
        else:
            done = outcome.status is Status.FINISHED
            why = outcome.error or RunError("", "")
            reason = live.report_unkept() if done else f"{why.kind}: {visible(why.message)}"
            state = MissionState.DONE if done else MissionState.FAILED
            self._end(live, state, reason, outcome.line, is_lost=False)

    def _run_program(self, live: LiveRobot) -> Outcome:
        with closing(Worker(one_process_per_run=True)) as worker:
            self.stop_button.on_press(worker.stop)
            if self.stop_button.ended.is_set():
                raise StoppedError
            return worker.run_live(self.summary.program, live)

    def _end(self, live: LiveRobot, state: MissionState, reason: str, line: object, *, is_lost: bool) -> None:
        """Enter a final state, but only once. A stop that did not reach the robot counts as a failure."""
        why = "" if is_lost else self.stop_button.why_unstopped()
        try:
            with self._writing:
                if self.has_ended:
                    return
                self.trace, self.may_move = live.trace, is_lost or bool(why)
                self._log_stop()
                if self.state is MissionState.STOPPING and why:
                    state, reason = MissionState.FAILED, why
                elif self.state is MissionState.STOPPING and not is_lost:
                    state, reason = MissionState.STOPPED, self.summary.reason
                    line = live.broken_rule.get("line")
                self._step(state, "end", reason=reason, line=line)
        except Exception as error:  # noqa: BLE001 - `run` raises it
            self._fault = error
        finally:
            self._is_over.set()
            self.stop_button.ended.set()

    def _log_stop(self) -> None:
        """Log the source of a stop and any broken rule, each only once."""
        with self._writing:
            by = self.stop_button.by
            if by is not None and self.state is MissionState.RUNNING:
                seconds = round(self.stop_button.seconds, 6)
                self._write("stop", by=by, seconds_to_cancel=seconds)
                self._step(MissionState.STOPPING, "be stopped", reason=stop_text(by))
            elif by is not None and not (self.state.is_moving or self.has_ended):
                self._step(MissionState.STOPPED, "be stopped", reason=f"{stop_text(by)} before it ran")
            rule = {} if self._live is None else self._live.broken_rule
            if rule != self._logged_rule:
                self._logged_rule = rule
                self._write("rule", **rule)

    def _leave(self, error: BaseException | None) -> None:
        if self.state.is_moving:
            self.stop(BY_SHUTDOWN)
        elif error is None or isinstance(error, KeyboardInterrupt | GeneratorExit):
            self.stop("CodeBotler")
        else:
            self.fail(visible(str(error)) or type(error).__name__)

    def _step(self, to: MissionState, what: str, **changes: object) -> None:
        """Change and log the state. The caller must hold the lock."""
        if to not in NEXT_STATES.get(self.state, ()):
            raise MissionError(f"mission {self.id} cannot {what}: its state is {self.state}")
        self.summary.state = to
        for name, value in changes.items():
            setattr(self.summary, name, value)
        if self.has_ended:
            self.summary.ended = time.time()
        shown = {name: value for name, value in changes.items() if value not in ("", None, ())}
        self._write("state", state=to, **shown)
        if self.has_ended:
            self._close()

    def _close(self) -> None:
        with self._writing:
            if self._log is not None:
                self._log.close()
            self._log = None

    def _write(self, event: str, /, **data: object) -> None:
        """Log an event and notify the listener, but drop events after the end of the mission."""
        clock = 0.0 if self._live is None else self._live.now
        with self._writing:
            if self._log is None:
                return
            if isinstance(picture := data.pop("picture", None), bytes):
                data |= self._pictures.keep(picture)
            line = add_event(self._log, event, clock, **data)
            if event == "state":
                self.summary.write(self.folder)
            self.on_event(line)


def _reason(error: BaseException) -> str:
    if isinstance(error, RobotLostError):
        return f"the robot was lost: {error.sentence}"
    sentence = visible(str(error))
    return sentence if isinstance(error, EngineError) else f"{type(error).__name__}: {sentence}"


def _make_mission_folder(missions: Path) -> Path:
    make_folder(missions)
    name = f"{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    for suffix in chain([""], map("-{}".format, count(2))):
        with suppress(FileExistsError):
            (folder := missions / f"{name}{suffix}").mkdir()
            return folder
    raise AssertionError("this loop ends only by returning a folder")
