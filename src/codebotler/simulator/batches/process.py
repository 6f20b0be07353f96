"""Runs tame programs in a child process, each in all its worlds, and sends a transcript of each run.

`sandbox.tame` explains tame programs. The child has its own copy of each robot and ledger, so programs never
wait for the engine. The engine replays each transcript on its own robot, which must give the same answers.
"""

from __future__ import annotations

import json
import sys
from _socket import MSG_WAITALL, socket
from collections.abc import Callable, Sequence
from marshal import loads
from pickle import loads as unpickled
from types import CodeType, ModuleType
from typing import Any, NoReturn

from codebotler.core.errors import RobotError
from codebotler.core.trace import Option
from codebotler.simulator.ledger import RememberingLedger, run_parameters
from codebotler.simulator.sandbox import BATCH_CPU_SECONDS, BATCH_MEMORY, HEADER, MAX_FRAME
from codebotler.simulator.sandbox.channel import receive, send_frames
from codebotler.simulator.sandbox.environment import simulate_environment
from codebotler.simulator.sandbox.execution import LimitReachedError, ProgramRun, robot_error
from codebotler.simulator.sandbox.fork_server import RUN_DOOR, serve
from codebotler.simulator.sandbox.isolation import give_up_rights, usable_filter
from codebotler.simulator.sandbox.start import arrange, reset_inherited_settings
from codebotler.simulator.sandbox.tame import GIVEN
from codebotler.simulator.worlds.robot import Argument, SimulatedRobot
from codebotler.simulator.worlds.sampled_robot import SampledRobot

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import TypeAlias

    from codebotler.simulator.sandbox.execution import SkillDescriptions

    # Skill, arguments, the program's clock, and kind and value of the answer.
    Called: TypeAlias = tuple[str, Sequence[Argument], float, str, Any]
    Batch: TypeAlias = tuple[SkillDescriptions, tuple[str, ...], bytes, list[tuple[bytes, list[int]]]]

# A run that recurses too deep here is repeated in its own process, where it may recurse far deeper.
BATCH_RECURSION_LIMIT = 400
MAX_TRANSCRIPT = MAX_FRAME // 6  # bytes; as ASCII, as in its own process, each call of it fits into a frame
UNDECIDED_RUN = b"null"  # replaces a transcript if the run must be repeated in its own process


def main(*descriptors: str) -> None:
    """Run a fork server for batches. `descriptors` are the numbers of a socket and a pipe to the engine."""
    reset_inherited_settings()
    arrange(list(map(int, descriptors)))
    door = socket(fileno=RUN_DOOR)
    run = TranscribedRun()
    simulate_environment(run)
    length = int.from_bytes(door.recv(HEADER), "big")
    rehearsal, lessons = loads(door.recv(length, MSG_WAITALL))  # noqa: S302 - from the engine
    sys.meta_path.clear()
    give_up_rights(BATCH_MEMORY)
    seccomp = usable_filter()
    for _ in range(lessons):
        transcripts(run, rehearsal)
    serve(door, run, lambda run: execute(run, rehearsal), seccomp, BATCH_CPU_SECONDS)


def execute(run: TranscribedRun, rehearsal: Batch) -> NoReturn:
    """Run the batch `rehearsal` to warm up. Then run the engine's batches, and send back transcripts."""
    # A child is forked before it is needed, and first runs a rehearsal, because the kernel copies each page
    # on the first write to it, which takes longer than most batches.
    transcripts(run, rehearsal)
    while True:
        transcripts(run, receive(), send_frames)


def transcripts(
    run: TranscribedRun,
    batch: Batch,
    send: Callable[[list[bytes]], None] = len,  # type: ignore[assignment]  # a rehearsal sends nothing
) -> None:
    """Run each program of a batch in its worlds with `run`, and `send` a record of each run's calls."""
    skills, elsewhere, pickled, programs = batch
    if skills != run.skills:
        run.provide(skills)
    run.elsewhere = frozenset(elsewhere)
    robots = unpickled(pickled)  # noqa: S301 - from the engine
    for code, numbers in programs:
        compiled = loads(code)  # noqa: S302 - from the engine
        # Before a run asks the engine for a skill, all earlier transcripts must have been sent.
        for group in [[number] for number in numbers] if elsewhere else [numbers]:
            send([run.transcript(compiled, *robots[number]) for number in group])


class TranscribedRun(ProgramRun):
    """Runs programs of a batch one after another in one process, and records the skill calls of each."""

    recursion_limit = BATCH_RECURSION_LIMIT

    def __init__(self) -> None:
        super().__init__()
        self.elsewhere: frozenset[str] = frozenset()  # skills that only the engine's robot can perform
        self.provided: dict[str, Any] = {}
        given = {name: vars(sys.modules["builtins"])[name] for name in GIVEN}
        self.builtins = {**given, **self.counters(), "__import__": lambda *_: sys.modules["time"]}

    def provide(self, skills: SkillDescriptions) -> None:
        """Provide the names that programs have without an import: the skills, `time` and some builtins."""
        self.skills = skills
        self.provided = {name: self.skill(name, parameters) for name, parameters in skills}
        self.provided.update(time=sys.modules["time"], __builtins__=self.builtins)

    def transcript(self, code: CodeType, kind: str, arguments: tuple[Any, ...]) -> bytes:
        """Run a program on the robot `ROBOTS[kind](*arguments)`. Return the run's record; `null` to rerun."""
        self._reset(ROBOTS[kind](*arguments))
        sys.setrecursionlimit(BATCH_RECURSION_LIMIT)
        end = self.execute(code, run_parameters(self.ledger.robot))
        data = UNDECIDED_RUN if self.is_undecided else self._written(end)
        return UNDECIDED_RUN if self.is_undecided else data

    def _reset(self, robot: SimulatedRobot) -> None:
        self.ledger = RememberingLedger(robot)
        self.namespace = ModuleType("__main__")
        vars(self.namespace).update(self.provided)
        self._calls: list[Called] = []
        self.has_reached_limit = self.entered = self.is_undecided = False
        self.refused_at = None
        self.codes.clear()
        self.refuel()

    def carry_out(self, name: str, arguments: list[Any]) -> Any:  # noqa: ANN401 - a skill may return any type
        """Execute a skill on our copy of the robot, or ask the engine if only it can. Return the result."""
        kinds = self.kinds[name]
        given = [_robot_argument(kind, value) for kind, value in zip(kinds, arguments, strict=True)]
        try:
            if self.now != self.ledger.robot.now:
                self._let_time_pass()
            answer = None if name in self.elsewhere else self.ledger.perform(name, given)
        except BaseException:  # the program is not at fault unless it reached a limit
            self.is_undecided = self.is_undecided or not self.has_reached_limit
            raise
        if answer is None:
            return self._ask_engine(name, given)
        kind, value = answer
        if kind == "error":
            self._calls.append((name, given, self.now, kind, value[1:]))
            raise robot_error(*value)
        self._calls.append((name, given, self.now, kind, value))
        if kind == "stop":
            self.has_reached_limit = True
            raise LimitReachedError
        return value.copy() if type(value) is list else value

    def _let_time_pass(self) -> None:
        """Report the program's clock to the ledger, and end the run if its time is up."""
        self.ledger.let_time_pass(self.now)
        if self.ledger.limit is not None:
            self.has_reached_limit = True
            raise LimitReachedError

    def request(self, request: str) -> NoReturn:  # noqa: ARG002 - as in ProgramRun
        """End the run. In a batch, the only request is a `sleep` past the limit of simulated time."""
        self._let_time_pass()
        raise LimitReachedError

    def except_hook(self, use_fuel: Callable[[], None]) -> Callable[[], None]:
        """Return the function that each `except` calls. It requests a rerun if stack or memory ran out."""

        def caught() -> None:
            error = sys.exc_info()[0]
            if error is not None and issubclass(error, RecursionError | MemoryError):
                self.is_undecided = True
            use_fuel()

        return caught

    def ended_by(self, error: BaseException) -> str:
        """Return as JSON how the program ended. Request a rerun after a recursion or memory error."""
        try:
            str(error)
        except (RecursionError, MemoryError):
            self.is_undecided = True
        self.is_undecided = self.is_undecided or isinstance(error, RecursionError | MemoryError)
        return super().ended_by(error)

    def _written(self, end: str) -> bytes:
        try:
            data = f"[{encoded([self._calls, self.now])[1:-1]},{end}]".encode()
        except UnicodeEncodeError:  # there are lone surrogates
            data = b""
        self.is_undecided = self.is_undecided or not 0 < len(data) <= MAX_TRANSCRIPT
        return data

    def _ask_engine(self, name: str, given: list[Argument]) -> Any:  # noqa: ANN401 - a skill may return any type
        """Let the engine's robot execute a skill, after it has repeated all earlier calls."""
        self._calls.append((name, given, self.now, "ask", None))
        data = self._written("null")
        if self.is_undecided:
            raise MemoryError
        send_frames([data])
        self._calls = []
        kind, value, self.now = receive()
        if kind == "error":
            self.ledger.errors.append(RobotError(*value[1:]))  # keeps the numbering in step with the engine's
            raise robot_error(*value)
        if kind == "stop":
            self.has_reached_limit = True
            raise LimitReachedError
        return value


def _robot_argument(kind: str, value: Any) -> Argument:  # noqa: ANN401 - a skill may take any type
    if kind == "list":
        return tuple([Option(str(each), isinstance(each, str)) for each in value])
    return tuple(value) if type(value) is list else value


ROBOTS: dict[str, type[SimulatedRobot]] = {"simulated": SimulatedRobot, "sampled": SampledRobot}
encoded = json.JSONEncoder(ensure_ascii=False, separators=(",", ":")).encode
