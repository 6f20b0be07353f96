"""`codebotler run` and `continue`: get a program, check it, ask for approval, and run it on the robot."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Thread
from typing import NoReturn

from rich.console import Group
from rich.text import Text

from codebotler.cli.programs.check import check_view, contract_view, read_program
from codebotler.cli.programs.generate import ADD_SENTENCE, ask_which, note_programless
from codebotler.cli.views import EventPrinter, continue_view, ending_view, source_view
from codebotler.core.errors import UserError
from codebotler.core.terminal import busy, confirm, note, print_rich, read_line, shortened
from codebotler.missions.display.view import MissionOrder, SessionView
from codebotler.missions.mission import STOP_GRACE_SECONDS, MissionError
from codebotler.missions.recovery import PriorApproval, past_to_recover
from codebotler.missions.session import MissionSession
from codebotler.missions.storage.log import MissionState
from codebotler.missions.storage.past import MissionPast
from codebotler.missions.storage.store import recover_missions
from codebotler.models.base import ModelError
from codebotler.models.recorded import RECORDED_NOTICE, is_recorded
from codebotler.robots.base import Robot
from codebotler.web.console import Console

SIGNALS = {
    signal.SIGINT: "Ctrl-C",
    signal.SIGTERM: "SIGTERM",
    signal.SIGHUP: "SIGHUP, since its terminal was closed",
}
SIGNAL_EXIT_BASE = 128
"""By the convention of shells, the exit status after a signal is this plus the signal's number."""


@dataclass(frozen=True)
class Request:
    """A user's request on the command line to run a program or an instruction.

    Raises:
        UserError: the request is empty, its file does not exist, or standard input is needed twice.
    """

    what: str  # a file, `-` for standard input, or an instruction
    yes: bool = False  # whether to run the program without asking
    despite_problems: bool = False  # whether to run the program even if the check finds problems
    shows_all: bool = False  # whether to show all different outcomes in imagined worlds, not just one
    past: MissionPast | None = None  # of the mission whose rest is requested
    recoveries: int = 0  # how many times a model may write the rest if a skill fails
    candidates: int = 1  # how many programs to get from the model, of which the user chooses one

    def __post_init__(self) -> None:
        if not self.what.strip():
            raise UserError("the argument is empty; name a program, or say what the robot should do")
        if self.what.endswith(".py") and not self.is_program:
            raise UserError("there is no such file; name a file, or write an instruction", file=self.what)
        if (self.recoveries or self.candidates > 1) and self.is_program and self.past is None:
            raise UserError("--recover and --candidates need an instruction, but the argument is a program")
        if self.what == "-" and not self.yes:
            raise UserError("standard input cannot hold both the program and your approval; add --yes")

    def order_on(self, console: Console) -> MissionOrder:
        """Return the mission to begin on the console. This reads the program file or standard input."""
        program = read_program(self.what) if self.is_program else ""
        if console.presses:  # while a person was asked what had happened
            raise UserError("STOP was pressed before the mission began; run this command again")
        if self.past is not None:
            return console.rest_of(self.past, program)
        return MissionOrder("" if program else self.what, program=program, asks=not self.yes)

    @property
    def is_program(self) -> bool:
        """Whether the request names a program rather than an instruction."""
        try:
            return self.what == "-" or Path(self.what).exists()
        except (OSError, ValueError):  # an instruction may be too long for a path or contain a null character
            return False


def run(console: Console, request: Request) -> int:
    """Carry out a user's request, from writing the program to the end of the mission, and show each step.

    If a skill fails, a model may write the rest, which is run in the same way.

    Returns:
        the exit status: 0 if the mission is done, 128 plus the number of a signal that stopped it, or else 1.
    """
    order, approval, begun, session = request.order_on(console), None, SessionView(), None
    if console.warning:
        note(console.warning)
    for left in range(request.recoveries, -1, -1):
        try:
            session = console.begin(order, after=session)
        except MissionError as error:  # a person has pressed STOP since
            note(error.sentence)
            print_rich(continue_view(begun))
            return 1
        try:
            status = _carry_out(session, console, request, approval)
        except KeyboardInterrupt:
            session.stop(SIGNALS[signal.SIGINT])
            raise
        except ModelError as error:  # without a rest, the status of the first mission counts
            if left == request.recoveries:
                raise
            note(error.sentence)
            status = 1
        begun = session.view if session.view.progress.has_begun else begun
        past = past_to_recover(session, console.robot, console.home) if left and status == 1 else None
        if past is None:
            if status and begun.id:
                print_rich(continue_view(begun))
            return status
        if approval is None or session.is_approved_by_person:
            approval = PriorApproval.of(session.view)
        order = console.rest_of(past)
        print_rich(past_view(past))
        note(f"recovering: asking {order.model} for the rest of the mission")
        request = replace(request, despite_problems=False)  # accepted for the first program only
    raise AssertionError("the last round returned no status; this is a bug")


def _carry_out(
    session: MissionSession, console: Console, request: Request, approval: PriorApproval | None
) -> int:
    """Show a mission's program, run it if the user approves it, and return the exit status."""
    view = _prepared(session)
    if view.programless is not None:
        note_programless(view.programless)
        session.reject(view.programless.sentence)
    elif view.check is None:
        note(f"not run: {shortened(view.reason)}")
    else:
        past = view.past
        is_covered = approval is not None and past is not None and approval.allows(view, past)
        if _is_approved(session, view, console.robot, request, is_covered=is_covered):
            return _watched(session, view, console, request, is_person=not (is_covered or request.yes))
    session.join(STOP_GRACE_SECONDS)
    return 1


def _prepared(session: MissionSession) -> SessionView:
    """Wait until the session has a checked program or ends, and show the progress."""
    view = session.view
    while not (view.is_over or view.may_be_approved or view.waits_for_program):
        if view.question is not None and view.waits_for_answer:
            answer = ask_which(view.question, read_line)
            adds = answer == "none" and not view.question.why_last
            session.answer(view.question, answer, read_line(ADD_SENTENCE) if adds else "")
            view = session.view
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
    is_named = request.is_program and not view.author
    if not is_named:
        if is_recorded(view.author):
            note(RECORDED_NOTICE)
        print_rich(source_view(view.program))
    name = request.what if is_named and request.what != "-" else "the program"
    print_rich(check_view(view.check, view.program, name, shows_all=request.shows_all))
    for sentence in (*view.missing_skills, *view.unknown_rooms):
        note(shortened(f"before the robot moves: {sentence}"))


def _is_approved(
    session: MissionSession, view: SessionView, robot: Robot, request: Request, *, is_covered: bool
) -> bool:
    """Show the check, and return whether the user approves the program now, or did before if `is_covered`."""
    _show_check(view, request)
    if view.contract is not None:
        print_rich(contract_view(view.contract, robot.skills))
    if view.problems and not (request.despite_problems and view.can_run):
        session.reject(f"the check found {'a problem' if len(view.problems) == 1 else 'problems'}")
        anyway = "; --despite-problems runs it anyway" if view.can_run else ""
        note(f"not run because of problems{anyway}")
        return False
    if is_covered:
        note("the rest of the mission stays within what was approved before")
    elif not request.yes and not confirm(f"run the program on the robot {robot.name}?"):
        session.stop("the person at the terminal")
        note("not run" if view.past else "not run; the robot has not moved")
        return False
    return True


def _watched(
    session: MissionSession, view: SessionView, console: Console, request: Request, *, is_person: bool
) -> int:
    """Run the program, print its events, and return the exit status."""
    with _stopped_by_signals(console) as got, EventPrinter(console.robot.name) as watcher:
        session.on_event = watcher
        with suppress(MissionError):  # the mission was stopped before it could start
            session.approve(view.digest, despite_problems=request.despite_problems, is_person=is_person)
        view = session.wait_until(lambda _: False)
    if session.error is not None:
        raise session.error
    print_rich(ending_view(view))
    if view.state is MissionState.DONE:
        return 0
    return SIGNAL_EXIT_BASE + got[0] if got else 1  # after a signal, nothing is recovered


def end_at_signals() -> None:
    """From now on, let SIGTERM and SIGHUP (a closed terminal) end this process cleanly, as Ctrl-C does."""

    def end(number: int, _frame: object) -> NoReturn:
        raise SystemExit(SIGNAL_EXIT_BASE + number)

    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, end)


@contextmanager
def _stopped_by_signals(console: Console) -> Iterator[list[int]]:
    """Stop the robot and hold agents when a signal arrives, and yield the signals received so far.

    SIGHUP stays ignored if it already was, as with `nohup`, so that the mission outlives its terminal.
    """
    got: list[int] = []

    def obey(number: int, _frame: object) -> None:
        console.stop(SIGNALS[signal.Signals(number)], holds=True)
        got.append(number)
        if len(got) > 1:
            note(f"\nasked the robot to stop; the robot has {STOP_GRACE_SECONDS:g} s to confirm")

    obeyed = [n for n in SIGNALS if n is not signal.SIGHUP or signal.getsignal(n) is not signal.SIG_IGN]
    before = {number: signal.signal(number, obey) for number in obeyed}
    try:
        yield got
    finally:
        for number, handler in before.items():  # further signals must not interrupt the cleanup
            signal.signal(number, signal.SIG_IGN if got else handler)


# --- the rest of a mission


def choose_past(console: Console, name: str, program: str) -> MissionPast:
    """Read what a mission did, show it, and ask a person whether the uncertain step, if any, happened.

    Args:
        console: the console with the robot. Before a question about a step, the robot is asked where it is.
        name: the ID of the mission, or `last`.
        program: the file with a program for the rest; `-` for standard input, empty if a model writes it.

    Raises:
        UserError: there is no such mission, it cannot be continued, it has no instruction and no
            program is named, or nobody answers.
    """
    recover_missions(console.home)
    past = console.past_of(name)
    if not (program or past.instruction):
        raise UserError(f"mission {past.mission} has no instruction; name a program for the rest")
    print_rich(past_view(past))
    if past.unsure is None:
        return past
    if program == "-":
        mend = "name a program file instead of `-`, so that you can answer y or n here"
        raise UserError(f"{past.unsure_step_text}; {mend}")
    evidence = [past.unsure_step_text]
    # On a thread, so that a signal ends the command meanwhile, and the end of the console stops the robot.
    asking = Thread(target=lambda: evidence.extend(console.ask_evidence(past, note)))
    asking.start()
    asking.join()
    for sentence in evidence:
        note(sentence)
    happened = _ask_whether(past)
    while happened and past.answers:
        known = " | ".join(map(shortened, past.answers))
        try:
            answer = read_line(f"what was the answer [{known}]? (Enter if you do not know) ").strip()
            return past.resolve(happened=True, answer=answer)
        except UserError as error:
            note(error.sentence)
    return past.resolve(happened=happened)


def _ask_whether(past: MissionPast) -> bool:
    """Ask until a person says whether a step happened. Raise UserError at the end of the input."""
    while answer := read_line("did this happen? [y/n] "):
        word = answer.strip().lower()
        if word in {"y", "yes", "n", "no"}:
            return word.startswith("y")
        note("answer y or n, or press Ctrl-C to end here")
    raise UserError(f"{past.unsure_step_text}; run this command again and answer y or n")


def past_view(past: MissionPast) -> Group:
    """Return what a mission did and saw before it ended, for printing."""
    head = Text.assemble((f"mission {past.mission}", "bold"), f" ended early: {shortened(past.why)}")
    steps = [Text(f"  {step}", "dim") for step in past.steps] or [Text("  no step was finished", "dim")]
    return Group(head, Text("done so far:"), *steps)
