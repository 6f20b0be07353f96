"""What `codebotler run` does: a program or an instruction, a check, somebody's word, and the robot's work."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from codebotler.checking.check import check
from codebotler.cli.check import check_view, read_program
from codebotler.cli.generate import generated
from codebotler.cli.missions import tell_interrupted
from codebotler.core.errors import UserError
from codebotler.core.terminal import busy, note, print_rich, says_yes, shortened
from codebotler.missions.mission import GRACE, Mission, MissionError, State
from codebotler.missions.preflight import beyond, preflight, unknown_rooms
from codebotler.missions.view import Watcher, ending, source_view
from codebotler.models.base import Model
from codebotler.prompts import prompt_for
from codebotler.robots.base import Robot
from codebotler.robots.reservation import Reservation
from codebotler.simulator.sampled_robot import RoomMap

SIGNALS = {
    signal.SIGINT: "Ctrl-C",
    signal.SIGTERM: "a signal to end",
    signal.SIGHUP: "the end of the terminal",
}
OF_SIGNALS = 128  # what shells add to the number of a signal, for the status of a process that it ended


@dataclass(frozen=True)
class Request:
    """What a user asks for.

    Args:
        what: a file, `-` for standard input, or an instruction.
        model: gives who writes the program for an instruction; called only then.
        yes: whether the program may be run without asking.
        despite_problems: whether it may be run if the check finds problems.

    Raises:
        UserError: it names a program that does not exist, or nothing, or nobody could be asked.
    """

    what: str
    model: Callable[[], Model]
    yes: bool = False
    despite_problems: bool = False

    def __post_init__(self) -> None:
        if not self.what.strip():
            raise UserError("nothing is asked for; name a program, or say what the robot is to do")
        if self.what.endswith(".py") and not self.is_program:
            raise UserError("there is no such file; name one, or write an instruction", file=self.what)
        if self.what == "-" and not self.yes:
            raise UserError(
                "the program comes on standard input, so that nobody can be asked there; add --yes"
            )

    @property
    def is_program(self) -> bool:
        """Whether it names a program, and does not ask for one."""
        try:
            return self.what == "-" or Path(self.what).exists()
        except (OSError, ValueError):  # too long for a name, or with a null character
            return False


def run(robot: Robot, request: Request, home: Path) -> int:
    """Bring a mission from a user's request to its end, and show all of it.

    Args:
        robot: not yet connected.
        request: what the user asks for.
        home: the folder of missions.

    Returns:
        the exit status: 0 if it is done, 1 if it is not, 128 and the number of the signal that stopped it.

    Raises:
        NotReadyError: the robot cannot be used.
        UserError: the program cannot be read, or the model not be asked.
        ModelError: no whole reply came.
    """
    program = read_program(request.what) if request.is_program else None
    tell_interrupted(home)
    instruction = "" if request.is_program else request.what
    with (
        _interrupts() as heed,
        contextlib.ExitStack() as held,
    ):
        with busy(f"connecting the robot {robot.name}"):
            reserved = held.enter_context(Reservation(robot, home))
        mission = held.enter_context(Mission(home, robot.name, instruction))
        heed()
        plan, place = preflight(robot)
        if program is None:
            model = request.model()
            program = written(model, request.what, plan)
            mission.draft(program, model.name)
        else:
            mission.draft(program)
        if not _is_approved(mission, program, robot, plan, request):
            return 1
        heed()
        return _watched(mission, reserved, place)


def written(model: Model, instruction: str, plan: RoomMap | None) -> str:
    """The program that a model writes for an instruction, with the rooms of the robot in mind."""
    if plan is None:
        return generated(model, prompt_for(instruction)).program
    return generated(model, prompt_for(instruction, rooms=plan.rooms), plan=plan).program


def _is_approved(
    mission: Mission, program: str, robot: Robot, plan: RoomMap | None, request: Request
) -> bool:
    """Show what a check finds, and ask."""
    found = check(program, plan=plan)
    name = request.what if request.is_program and request.what != "-" else "the program"
    if not request.is_program:
        print_rich(source_view(program))
    print_rich(check_view(found, program, name))
    lacking = beyond(program, robot)
    problems = [*(problem.sentence for problem in found.problems), *lacking]
    mission.check(problems)
    unknown = unknown_rooms(program, plan) if plan and not found.problems else []
    for sentence in (*lacking, *unknown):
        told = f"before it moves: {sentence}"
        mission.note(told)
        note(shortened(told))
    if problems and not request.despite_problems:
        mission.fail(f"the check found {'a problem' if len(problems) == 1 else 'problems'}")
        note("not run, since it has problems; --despite-problems runs it all the same")
        return False
    if not request.yes and not says_yes(f"run it on the robot {mission.summary.robot}?"):
        mission.stop("the word of a person")
        note("not run; nothing has moved")
        return False
    mission.approve(despite_problems=request.despite_problems)
    return True


def _watched(mission: Mission, reserved: Reservation, place: str) -> int:
    """Run it before a user's eyes."""
    with _stopped_by_signals(mission) as got, Watcher(mission.summary) as watcher:
        mission.told = watcher
        with contextlib.suppress(MissionError):  # it was stopped before it could run
            mission.run(reserved, place)
    print_rich(ending(mission.summary))
    if mission.state is State.STOPPED and got:
        return OF_SIGNALS + got[0]
    return 0 if mission.state is State.DONE else 1


@contextlib.contextmanager
def _interrupts() -> Iterator[Callable[[], None]]:
    """Remember Ctrl-C, which libraries swallow or take for a fault of their own while they are imported.

    Gives what raises it again if it came; an exception that comes after it counts as Ctrl-C itself.
    """
    came: list[int] = []

    def obey(number: int, _frame: object) -> None:
        came.append(number)
        raise KeyboardInterrupt

    def heed() -> None:
        if came:
            raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, obey)
    try:
        yield heed
    except Exception:
        heed()
        raise
    finally:
        if signal.getsignal(signal.SIGINT) is obey:
            signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def _stopped_by_signals(mission: Mission) -> Iterator[list[int]]:
    """Stop the mission when a signal comes, and tell which came; a second one cancels once more.

    Whoever began this with `nohup` wants it to outlive the terminal.
    """
    got: list[int] = []

    def stop(name: str) -> None:
        with contextlib.suppress(MissionError, OSError):
            mission.stop(name)

    def obey(number: int, _frame: object) -> None:
        threading.Thread(target=stop, args=(SIGNALS[signal.Signals(number)],), daemon=True).start()
        got.append(number)
        if len(got) > 1:
            note(f"\nthe robot was told to stop; it has {GRACE:g} s to confirm that")

    outlives = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    obeyed = [number for number in SIGNALS if not (outlives and number is signal.SIGHUP)]
    before = {number: signal.signal(number, obey) for number in obeyed}
    try:
        yield got
    finally:
        for number, handler in before.items():  # who was impatient must not break the tidying up
            signal.signal(number, signal.SIG_IGN if got else handler)
