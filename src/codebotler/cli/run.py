"""`codebotler run`: a program or an instruction, a check, a person's approval, and the robot's work."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from codebotler.checking.check import check
from codebotler.checking.problems import CheckResult
from codebotler.cli.check import check_view, read_program
from codebotler.cli.generate import note_programless
from codebotler.cli.views import EventPrinter, ending_view, source_view
from codebotler.core.errors import UserError
from codebotler.core.skills.table import SkillTable
from codebotler.core.terminal import busy, confirm, note, print_rich, shortened
from codebotler.core.words import listed
from codebotler.core.world import World
from codebotler.missions.log import MissionState
from codebotler.missions.mission import STOP_GRACE_SECONDS, MissionError
from codebotler.missions.session import MissionSession
from codebotler.missions.store import recover_missions
from codebotler.missions.view import MissionOrder, SessionView
from codebotler.models.base import Model
from codebotler.models.recorded import RECORDED_NOTICE, is_recorded
from codebotler.robots.base import Robot
from codebotler.simulator.house_rule import Rule
from codebotler.simulator.sampled_robot import RoomMap

SIGNALS = {
    signal.SIGINT: "Ctrl-C",
    signal.SIGTERM: "SIGTERM",
    signal.SIGHUP: "SIGHUP, since its terminal was closed",
}
SIGNAL_EXIT_BASE = 128
"""Shells add this to the number of the signal that ended a process."""

CLEANUP_SECONDS = 2.0
"""How long a mission may take to end after Ctrl-C while the robot has not moved yet."""


@dataclass(frozen=True)
class Request:
    """What a user asks for on the command line.

    Raises:
        UserError: it names a missing program or nothing, or approval would be read from where the program is.
    """

    what: str  # a file, `-` for standard input, or an instruction
    model: str = "recorded"  # writes the program for an instruction
    yes: bool = False  # whether to run the program without asking
    despite_problems: bool = False
    shows_all: bool = False  # of the kinds of imagined worlds in which it does something else
    rules: tuple[Rule, ...] = ()  # of the house

    def __post_init__(self) -> None:
        if not self.what.strip():
            raise UserError("the argument is empty; name a program, or say what the robot should do")
        if self.what.endswith(".py") and not self.is_program:
            raise UserError("there is no such file; name a file, or write an instruction", file=self.what)
        if self.what == "-" and not self.yes:
            raise UserError("the program comes from standard input, so you cannot be asked there; add --yes")

    @property
    def is_program(self) -> bool:
        """Whether it names a program."""
        try:
            return self.what == "-" or Path(self.what).exists()
        except (OSError, ValueError):  # too long for a name, or with a null character
            return False


def run(
    robot: Robot,
    request: Request,
    home: Path,
    open_model: Callable[[str], Model],
    world: World | None = None,
) -> int:
    """Take a user's request to its end, and show all of it.

    Args:
        robot: the robot.
        request: what the user asks for.
        home: the folder of missions.
        open_model: opens a model by its name.
        world: the map, if there is one.

    Returns:
        the exit status: 0 if the mission is done, 1 if it is not, 128 plus the number of the signal that
        stopped it.
    """
    program = read_program(request.what) if request.is_program else ""
    tell_missing(robot)
    recover_missions(home)
    order = MissionOrder(program=program) if program else MissionOrder(request.what, request.model)
    checked = checker(robot.skills)
    session = MissionSession(
        robot, home, order, open_model=open_model, check=checked, rules=request.rules, world=world
    )
    session.start()
    try:
        view = _prepared(session)
        if view.programless is not None:
            note_programless(view.programless)
            session.reject(view.programless.sentence)
        elif _is_approved(session, view, robot, request):
            return _watched(session, view, robot, request)
    except BaseException as error:
        session.stop(SIGNALS[signal.SIGINT] if isinstance(error, KeyboardInterrupt) else "an error")
        session.join(CLEANUP_SECONDS)
        raise
    session.join(STOP_GRACE_SECONDS)
    return 1


def tell_missing(robot: Robot) -> None:
    """Say what a robot lacks, as far as that is known before it is connected."""
    if robot.missing:
        note(f"{robot.name} has no {listed(list(robot.missing))}; models read of its other skills only")


def checker(skills: SkillTable) -> Callable[[str, RoomMap | None, tuple[Rule, ...]], CheckResult]:
    """The check of programs for a robot that has these skills."""

    def checked(program: str, room_map: RoomMap | None, rules: tuple[Rule, ...]) -> CheckResult:
        return check(program, room_map=room_map, house_rules=rules, skills=skills)

    return checked


def _prepared(session: MissionSession) -> SessionView:
    """Wait for a checked program, and show what goes on meanwhile."""
    view = session.view
    while not (view.is_over or view.may_be_approved or view.waits_for_program):
        before = view.busy
        with busy(before or "finishing"):
            view = session.wait_until(lambda now, before=before: now.busy != before)  # type: ignore[misc]  # mypy does not infer such lambdas
    for remark in view.remarks:
        note(remark)
    if session.error is not None:
        raise session.error
    return view


def _show_check(view: SessionView, request: Request) -> None:
    assert view.check is not None, "the program is checked"
    if not request.is_program:
        if is_recorded(view.author):
            note(RECORDED_NOTICE)
        print_rich(source_view(view.program))
    name = request.what if request.is_program and request.what != "-" else "the program"
    print_rich(check_view(view.check, view.program, name, shows_all=request.shows_all))
    for sentence in (*view.missing_skills, *view.unknown_rooms):
        note(shortened(f"before the robot moves: {sentence}"))


def _is_approved(session: MissionSession, view: SessionView, robot: Robot, request: Request) -> bool:
    """Show the check, and have a person approve the program."""
    _show_check(view, request)
    if view.problems and not (request.despite_problems and view.can_run):
        session.reject(f"the check found {'a problem' if len(view.problems) == 1 else 'problems'}")
        anyway = "; --despite-problems runs it anyway" if view.can_run else ""
        note(f"not run because of problems{anyway}")
        return False
    if not request.yes and not confirm(f"run the program on the robot {robot.name}?"):
        session.stop("the person at the terminal")
        note("not run; the robot has not moved")
        return False
    return True


def _watched(session: MissionSession, view: SessionView, robot: Robot, request: Request) -> int:
    """Run the program before the user's eyes."""
    with _stopped_by_signals(session) as got, EventPrinter(robot.name) as watcher:
        session.on_event = watcher
        with suppress(MissionError):  # it was stopped before it could run
            session.approve(view.digest, despite_problems=request.despite_problems)
        view = session.wait_until(lambda _: False)
    if session.error is not None:
        raise session.error
    print_rich(ending_view(view))
    if view.state is MissionState.STOPPED and got:
        return SIGNAL_EXIT_BASE + got[0]
    return 0 if view.state is MissionState.DONE else 1


@contextmanager
def _stopped_by_signals(session: MissionSession) -> Iterator[list[int]]:
    """Stop the session at a signal, and list those that came.

    A mission started with `nohup` outlives its terminal.
    """
    got: list[int] = []

    def obey(number: int, _frame: object) -> None:
        session.stop_soon(SIGNALS[signal.Signals(number)])
        got.append(number)
        if len(got) > 1:
            note(f"\nasked the robot to stop; it has {STOP_GRACE_SECONDS:g} s to confirm")

    outlives = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    obeyed = [number for number in SIGNALS if not (outlives and number is signal.SIGHUP)]
    before = {number: signal.signal(number, obey) for number in obeyed}
    try:
        yield got
    finally:
        for number, handler in before.items():  # an impatient user must not break the tidying up
            signal.signal(number, signal.SIG_IGN if got else handler)
