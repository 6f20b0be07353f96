"""Programs that try to break out, to do harm or to cheat fail; each file of tests/hostile is one.

A program's first line says what it tries. Comments below say how its run must end (`# ends: STATUS KIND`),
what its robot must have done (`# does: KIND TEXT`, one line per event; nothing by default) and whether it
solves the task (`# earns: yes`; no by default). `@NAME@` is replaced by something real that it could
reach if a layer of isolation were missing.
"""

import _ctypes
import contextlib
import ctypes
import json
import math
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Container, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import groupby, pairwise
from pathlib import Path
from typing import IO

import pytest

from codebotler.core.files import to_line
from codebotler.core.trace import Event, Outcome, Status, outcome_data
from codebotler.core.world import Person, Room, World
from codebotler.rtl import parse
from codebotler.simulator.process.errors import PROCESSOR_TIME
from codebotler.simulator.process.fork_server_client import BatchServer
from codebotler.simulator.process.isolated_process import IsolatedProcess
from codebotler.simulator.settings import SimulationSettings
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.robot import SimulatedRobot
from haste import hasten
from roboeval.evaluation.judging.judge import judge
from roboeval.suites.load import Requirement, Scenario

ONE_A_LAYER = {  # the others are slow
    *("backdoors_callers", "backdoors_swallows_in_except", "files_read_secret", "judge_forged_record"),
    *("leaves_patched_builtins", "memory_at_once", "network_tcp", "processes_fork", "processes_kill_engine"),
    *("protocol_forged_finish", "protocol_half_a_frame_then_silence", "time_thread"),
}
PROGRAMS = sorted((Path(__file__).parents[2] / "hostile").glob("*.py"))
AS_WRITTEN = SimulationSettings(literals="as-written")
SECRET = "hush-" + os.urandom(8).hex()
MARKER = "i-was-here-" + os.urandom(8).hex()
NOBODY = 65534
PHRASE = "open sesame"
WORLD = World(
    (Room("start"), Room("vault", (SECRET,), (Person(".*", ("yes", SECRET)),))), "start", about=SECRET
)
SAYS_IT_THERE = parse(f'tr.ActAtFirst("vault", say("{PHRASE}"))')
ASKED = Scenario(WORLD, (Requirement("says it there", "says it there", SAYS_IT_THERE, "SayAtLocation"),))
MAX_SECONDS = 25.0  # the watchdog's limit is five, but the machine may be busy
HONEST = """
import builtins, collections, fractions, json, os, random, statistics, string, sys, textwrap, timeit

def task_program():
    gc = timeit.gc
    go_to("vault")
    say("open sesame")
    say(str([len(vars(builtins)), sorted("ba"), hash("a"), id([]), str(object())]))
    say(str([len(vars(str)), "a".upper(), len(sys.modules), len(vars(json)), len(vars(random))]))
    say(str([random.random(), random.choice("abc"), string.ascii_lowercase, json.dumps([1, {"a": 2}])]))
    say(str([str(collections.Counter("aab")), fractions.Fraction(1, 2) + 1]))
    say(str([textwrap.fill.__defaults__, statistics.quantiles([1, 2, 3, 4])]))
    say(str([dict(os.environ), time.time(), time.monotonic(), sys.argv, sys.path, len(sys.meta_path)]))
    say(str([sys.getrecursionlimit(), sys.get_int_max_str_digits(), gc.get_threshold(), gc.isenabled()]))
"""

TAME = "def task_program():\n    pass\n"


@dataclass(frozen=True)
class Expectation:
    """The outcome that a program's comments announce."""

    ends: tuple[str, ...]
    does: tuple[str, ...]
    earns: bool


def read_expectation(source: str) -> Expectation:
    lines = [line[2:].partition(": ") for line in source.splitlines() if line.startswith("# ")]
    ends = next(value for name, _, value in lines if name == "ends")
    does = tuple(value for name, _, value in lines if name == "does")
    return Expectation(tuple(ends.split(" | ")), does, ("earns", ": ", "yes") in lines)


def render(event: Event) -> str:
    """Write an event as in the comments, with `*` after an option that is not text."""
    offered = [shorten(option.text) + "*" * (not option.is_text) for option in event.options]
    options = ", ".join(count_repeats(offered))
    asked = f": {options}" if event.kind == "ask" else ""
    answered = "" if event.answer is None else f" -> {event.answer}"
    return f"{event.kind} {shorten(event.text)}{asked}{answered}"


def shorten(text: str) -> str:
    return (text if len(text) < 100 else text[:3] + "...").encode("unicode_escape").decode()


def count_repeats(texts: Iterable[str]) -> tuple[str, ...]:
    """Replace equal texts in a row by their number and the text."""
    groups = [(text, len(list(group))) for text, group in groupby(texts)]
    return tuple(text if count == 1 else f"{count} times {text}" for text, count in groups)


def render_trace(outcome: Outcome) -> tuple[str, ...]:
    return count_repeats(map(render, outcome.trace))


# --- things within reach if a layer of isolation were missing


def read_of_all(name: str) -> Iterator[tuple[int, bytes]]:
    """Yield a file of `/proc` for each process."""
    for pid in filter(str.isdigit, os.listdir("/proc")):  # noqa: PTH208 - much faster, and called very often
        with contextlib.suppress(OSError), open(f"/proc/{pid}/{name}", "rb", 0) as file:  # noqa: PTH123 - so is this
            yield int(pid), file.read()


def process_table() -> dict[int, tuple[int, str]]:
    """Return the parent and the state of each process."""
    found = {}
    for pid, stat in read_of_all("stat"):
        state, parent, *_ = stat.rpartition(b")")[2].split(None, 2)
        found[pid] = (int(parent), state.decode())
    return found


def living_below(*pids: int) -> set[int]:
    """Return the processes below some that are neither dead nor stopped by a signal."""
    table = process_table()
    found: set[int] = set()
    while more := {one for one, (parent, _) in table.items() if parent in {*pids, *found}} - found:
        found |= more
    return {one for one in found if table[one][1] not in "ZTt"}


def processes_with_marker() -> set[int]:
    """Return all processes whose command line has the marker."""
    return {pid for pid, words in read_of_all("cmdline") if MARKER.encode() in words}


def descriptors(pid: int, excluding: Container[int] = ()) -> dict[str, str]:
    found = {}
    for link in [link for link in Path(f"/proc/{pid}/fd").iterdir() if int(link.name) not in excluding]:
        with contextlib.suppress(OSError):
            found[link.name] = str(link.readlink())
    return found


BYSTANDER = f"""
import os, signal
signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
if os.geteuid() == 0:
    os.setgroups([])
    os.setresgid({NOBODY}, {NOBODY}, {NOBODY})
    os.setresuid({NOBODY}, {NOBODY}, {NOBODY})
os.write(1, b"ready")
while True:
    os.write(1, b"%d " % signal.sigwait(signal.valid_signals()))
"""
WATCHED_SIGNALS = (
    *(signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1, signal.SIGUSR2, signal.SIGALRM, signal.SIGTERM),
    *(signal.SIGCONT, signal.SIGVTALRM, signal.SIGPROF, signal.SIGIO, signal.SIGURG, signal.SIGXFSZ),
)
PR_SET_CHILD_SUBREAPER = 36


@dataclass
class Reach:
    """Real targets around the engine, with checks whether a program touched them."""

    folder: Path
    worker: Worker
    bystander: subprocess.Popen[bytes]
    listeners: dict[str, socket.socket]
    signals: list[int] = field(default_factory=list)

    @property
    def signal_log(self) -> IO[bytes]:
        """Return the pipe to which the bystander writes each signal."""
        assert self.bystander.stdout is not None
        return self.bystander.stdout

    def placeholders(self) -> dict[str, str]:
        """Return the value of each `@NAME@`."""
        return {
            "SECRET_FOLDER": str(self.folder / "secret"),
            "SECRET_FILE": str(self.folder / "secret" / "secret"),
            "CANARY_FOLDER": str(self.folder / "canary"),
            "PORT": str(self.listeners["tcp"].getsockname()[1]),
            "UDP_PORT": str(self.listeners["udp"].getsockname()[1]),
            "UNIX_SOCKET": str(self.folder / "socket"),
            "ABSTRACT_SOCKET": MARKER,
            "MARKER": MARKER,
            "PARENT_PID": str(os.getpid()),
            "FORK_SERVER_PID": str(self.fork_servers()[-1]),
            "BYSTANDER_PID": str(self.bystander.pid),
        }

    def fill(self, source: str) -> str:
        for name, value in self.placeholders().items():
            source = source.replace(f"@{name}@", value)
        return source

    def fork_servers(self) -> list[int]:
        """Return the fork servers of the worker."""
        return [fork_server._process.pid for fork_server in self.worker._fork_servers.values()]

    def run(self, source: str) -> Outcome:
        outcome = self.worker.run(source, lambda: SimulatedRobot(WORLD, AS_WRITTEN))
        until = time.monotonic() + 1  # the kernel takes a moment to end the child
        while time.monotonic() < until and self.living_below(*self.fork_servers()):
            select.select([], [], [], 0.001)
        return outcome

    def living_below(self, *parents: int) -> set[int]:
        """Return the processes below some, without the child that is forked ahead for the next run."""
        return living_below(*parents) - {ahead.pid for ahead in self.ahead()}

    def ahead(self) -> list[IsolatedProcess]:
        """Return the child that is forked ahead for the next run, if there is one."""
        server = self.worker._fork_servers.get(BatchServer)
        return [server._next] if isinstance(server, BatchServer) and server._next else []

    def files(self) -> dict[str, object]:
        """Return the folder and all files below it, with contents, rights and times."""
        found: dict[str, object] = {}
        for path in [self.folder, *self.folder.rglob("*")]:
            about = path.lstat()
            content = path.read_bytes() if path.is_file() else b""
            found[str(path)] = (about.st_mode, about.st_uid, about.st_nlink, about.st_mtime_ns, content)
        return found

    def state(self) -> dict[str, object]:
        """Return everything that a run must leave unchanged."""
        spoken_to = {name: listener.fileno() for name, listener in self.listeners.items()}
        spoken_to["bystander"] = self.signal_log.fileno()
        ready = select.select(spoken_to.values(), [], [], 0)[0]
        return {
            "files": self.files(),
            "who was spoken to": {name for name, number in spoken_to.items() if number in ready},
            "signals": list(self.signals),
            "living processes": self.living_below(os.getpid()),
            "processes with the marker": processes_with_marker(),
            "fork_servers": self.fork_servers(),
            "descriptors": descriptors(os.getpid(), excluding={a._channel.fileno() for a in self.ahead()}),
            "descriptors of the fork servers": list(map(descriptors, self.fork_servers())),
        }


@pytest.fixture(scope="module")
def folder() -> Iterator[Path]:
    """Yield a folder that everybody may read, with a secret and a part that everybody may write to."""
    path = Path(tempfile.mkdtemp(prefix="hostile-"))
    path.chmod(0o755)
    for name, rights in (("secret", 0o755), ("canary", 0o777)):
        (path / name).mkdir()
        (path / name).chmod(rights)
    (path / "secret" / "secret").write_text(SECRET, encoding="ascii")
    (path / "secret" / "hushed.py").write_text(f"SECRET = '{SECRET}'\n", encoding="ascii")
    with zipfile.ZipFile(path / "secret" / "hushed.zip", "w") as archive:
        archive.writestr("zipped.py", f"SECRET = '{SECRET}'\n")
    shutil.copyfile(_ctypes.__file__, path / "secret" / "hushed.so")
    (path / "canary" / "canary").write_text("sings", encoding="ascii")
    (path / "canary" / "canary").chmod(0o666)
    yield path
    shutil.rmtree(path)


@pytest.fixture(scope="module")
def listeners(folder: Path) -> Iterator[dict[str, socket.socket]]:
    with contextlib.ExitStack() as stack:
        found = {}
        for name, family, kind, address in (
            ("tcp", socket.AF_INET, socket.SOCK_STREAM, ("127.0.0.1", 0)),
            ("udp", socket.AF_INET, socket.SOCK_DGRAM, ("127.0.0.1", 0)),
            ("unix", socket.AF_UNIX, socket.SOCK_STREAM, str(folder / "socket")),
            ("abstract", socket.AF_UNIX, socket.SOCK_STREAM, "\0" + MARKER),
        ):
            listener = stack.enter_context(socket.socket(family, kind))
            listener.bind(address)
            if kind == socket.SOCK_STREAM:
                listener.listen()
            found[name] = listener
        (folder / "socket").chmod(0o777)
        yield found


@pytest.fixture(scope="module")
def bystander() -> Iterator[subprocess.Popen[bytes]]:
    """Yield a process of the same user as programs, which writes every signal to its output."""
    with subprocess.Popen([sys.executable, "-c", BYSTANDER], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.read(5) == b"ready"
        yield process
        process.kill()


@pytest.fixture(scope="module")
def reach(
    folder: Path, bystander: subprocess.Popen[bytes], listeners: dict[str, socket.socket]
) -> Iterator[Reach]:
    """Yield all targets; orphans become children of this process, so that none can hide."""
    libc = ctypes.CDLL(None)
    os.environ["SECRET_OF_THE_ENGINE"] = SECRET
    reach = Reach(folder, Worker(), bystander, listeners)
    for program in (TAME, f"class A: pass\n{TAME}", HONEST):
        reach.run(program)  # these runs start all processes
    before = {
        number: signal.signal(number, lambda n, _: reach.signals.append(n)) for number in WATCHED_SIGNALS
    }
    assert libc.prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0) == 0
    yield reach
    for pid in processes_with_marker():  # a failed test may have left processes
        os.kill(pid, signal.SIGKILL)
    assert libc.prctl(PR_SET_CHILD_SUBREAPER, 0, 0, 0, 0) == 0
    for number, handler in before.items():
        signal.signal(number, handler)
    reach.worker.close()
    del os.environ["SECRET_OF_THE_ENGINE"]


@pytest.fixture(scope="module")
def honest(reach: Reach) -> Outcome:
    """Return the outcome of an honest program in a separate worker, before any hostile run."""
    worker = Worker()
    try:
        outcome = worker.run(HONEST, lambda: SimulatedRobot(WORLD, AS_WRITTEN))
    finally:
        worker.close()
    assert outcome.status is Status.FINISHED, outcome
    assert render_trace(outcome)[:2] == ("goto vault", f"say {PHRASE}")
    assert judge(outcome, ASKED).satisfied
    assert reach.run(HONEST) == outcome
    return outcome


# --- the tests


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=[pytest.mark.slow] * (path.stem not in ONE_A_LAYER)) for path in PROGRAMS],
    ids=lambda path: path.stem,
)
def test_hostile_program_gets_nothing(
    path: Path, reach: Reach, honest: Outcome, monkeypatch: pytest.MonkeyPatch
) -> None:
    if path.stem.startswith("cpu"):
        hasten(monkeypatch)
    source = reach.fill(path.read_text(encoding="utf-8"))
    wanted = read_expectation(source)
    before = reach.state()
    start = time.monotonic()
    outcome = reach.run(source)
    assert time.monotonic() - start < MAX_SECONDS
    after = reach.state()
    for name, value in before.items():
        assert after[name] == value, name
    assert before["who was spoken to"] == set()

    kind = "" if outcome.error is None else f" {outcome.error.kind}"
    assert f"{outcome.status}{kind}" in wanted.ends, outcome
    assert render_trace(outcome) == wanted.does
    assert SECRET not in f"{outcome!r} {outcome.trace!r}"

    verdict = judge(outcome, ASKED)
    was_there = any((e.kind, e.text, e.place) == ("say", PHRASE, "vault") for e in outcome.trace)
    assert verdict.satisfied is wanted.earns is (was_there and outcome.status is Status.FINISHED)
    assert_record_is_valid(outcome)

    assert reach.run(HONEST) == honest


def assert_record_is_valid(outcome: Outcome) -> None:
    """Fail unless an outcome fits into one row of a file, with bounded errors and an increasing clock."""
    data = outcome_data(outcome)
    line = to_line(data)
    assert line.count(b"\n") == 1
    assert json.loads(line) == data
    assert outcome.error is None or len(outcome.error.kind) + len(outcome.error.message) <= 1100
    assert outcome.line is None or 0 < outcome.line <= 1_000_000
    times = [0.0, *(event.time for event in outcome.trace), 3600.0]
    assert all(map(math.isfinite, times))
    assert all(one <= other for one, other in pairwise(times))


def test_every_program_starts_with_a_sentence_about_its_attack() -> None:
    assert len(PROGRAMS) >= 90
    for path in PROGRAMS:
        first = path.read_text(encoding="utf-8").splitlines()[0]
        assert first.startswith('"""Tries '), path.name
        assert first.endswith('."""'), path.name


@pytest.mark.slow
def test_silent_program_is_ended_even_while_it_computes(
    reach: Reach, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("codebotler.simulator.process.isolated_process.PROCESS_WAIT_SECONDS", 0.1)
    outcome = reach.run("import math\n\ndef task_program():\n    sum(range(10**12))\n")
    assert outcome.status is Status.TIMEOUT
    assert outcome.error is not None
    assert not outcome.error.message.endswith(PROCESSOR_TIME)


# --- the checks notice each kind of damage


@pytest.fixture
def name_changes(reach: Reach) -> Callable[[], set[str]]:
    """Return a function that names the changes since the test began."""
    before = reach.state()
    return lambda: {name for name, value in reach.state().items() if value != before[name]}


def test_written_file_is_noticed(reach: Reach, name_changes: Callable[[], set[str]]) -> None:
    about = (reach.folder / "canary").stat()
    (reach.folder / "canary" / "new").touch()
    assert name_changes() == {"files"}
    (reach.folder / "canary" / "new").unlink()
    os.utime(reach.folder / "canary", ns=(about.st_atime_ns, about.st_mtime_ns))
    assert name_changes() == set()


@pytest.mark.parametrize("name", ["tcp", "udp", "unix", "abstract"])
def test_connection_is_noticed(reach: Reach, name_changes: Callable[[], set[str]], name: str) -> None:
    listener = reach.listeners[name]
    with socket.socket(listener.family, listener.type) as caller:
        caller.connect(listener.getsockname())
        if name == "udp":
            caller.send(b"x")
            assert name_changes() >= {"who was spoken to"}
            listener.recv(1)
        else:
            assert name_changes() >= {"who was spoken to"}
            listener.accept()[0].close()
    assert name_changes() == set()


def test_signal_is_noticed(reach: Reach, name_changes: Callable[[], set[str]]) -> None:
    os.kill(os.getpid(), signal.SIGUSR1)
    os.kill(reach.bystander.pid, signal.SIGTERM)
    select.select([reach.signal_log], [], [], 10)
    assert name_changes() == {"signals", "who was spoken to"}
    assert os.read(reach.signal_log.fileno(), 10) == b"15 "
    reach.signals.clear()
    assert name_changes() == set()


def test_stopped_fork_server_is_noticed(reach: Reach, name_changes: Callable[[], set[str]]) -> None:
    os.kill(reach.fork_servers()[-1], signal.SIGSTOP)
    os.waitid(os.P_PID, reach.fork_servers()[-1], os.WSTOPPED | os.WNOWAIT)
    assert name_changes() == {"living processes"}
    os.kill(reach.fork_servers()[-1], signal.SIGCONT)
    while name_changes():
        select.select([], [], [], 0.01)


def test_orphan_is_noticed(name_changes: Callable[[], set[str]]) -> None:
    orphaning = f"import os, time; os.fork() or (os.setsid(), time.sleep(60), '{MARKER}')"
    subprocess.run([sys.executable, "-c", orphaning], check=True)
    assert name_changes() == {"living processes", "processes with the marker"}
    (orphan,) = processes_with_marker()
    os.kill(orphan, signal.SIGKILL)
    os.waitpid(orphan, 0)
    assert name_changes() == set()
