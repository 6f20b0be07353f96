"""The isolated side of the engine: a zygote that forks one closed child for each run of a program.

The engine starts this file by its path with a bare interpreter, so it imports only the standard library. A
child holds the program and nothing else: the world, the robot and the trace stay with the engine, and the
child asks for skills over a socket. Everything it says is checked there; here is only what keeps it in.
"""

from __future__ import annotations

import ast
import builtins
import contextlib
import ctypes
import fcntl
import gc
import importlib
import io
import itertools
import json
import os
import platform
import resource
import select
import signal
import site
import socket
import struct
import sys
import types
from collections.abc import Callable
from typing import Any, NoReturn

CHANNEL = 3
WAKE, DOOR, REPORT = 4, 5, 6
MAX_FRAME = 1_000_000
PROGRAM = "<program>"
HEADER = 4
# Python 3.11 counts calls into C as well: with three more, a function can call itself as often as under 3.12.
RECURSION_LIMIT = 1000 if sys.version_info >= (3, 12) else 1003
TICK, ENTER = "<tick>", "<enter>"  # names that no source text can spell

PRELOADED = """
    abc array asyncio base64 bisect calendar cmath codecs collections collections.abc colorsys
    concurrent.futures contextlib copy csv dataclasses datetime _strptime decimal difflib enum fractions
    functools hashlib heapq html inspect io itertools json keyword locale logging math numbers operator
    os os.path pathlib pprint queue random re secrets shlex signal socket statistics string struct
    subprocess sys tempfile textwrap threading time timeit traceback types typing unicodedata unittest
    unittest.mock uuid warnings weakref zoneinfo encodings.ascii encodings.base64_codec
    encodings.charmap encodings.cp1252 encodings.hex_codec encodings.idna encodings.latin_1
    encodings.punycode encodings.raw_unicode_escape encodings.rot_13 encodings.unicode_escape
    encodings.utf_16 encodings.utf_16_be encodings.utf_16_le encodings.utf_32 encodings.utf_7
    encodings.utf_8 encodings.utf_8_sig
""".split()  # noqa: SIM905 - a list of a hundred quoted words is no easier to read


class BudgetSpentError(BaseException):
    """The run has reached a limit; every further tick and skill call raises it again."""


class RobotError(Exception):
    """The robot could not do what the program asked for."""

    number = -1


# --- the program: parsed, given ticks, run


def prepared(source: str, *, lowercase: bool) -> types.CodeType:
    """Parse a program, lower its literals if the suite wants it, and compile it with ticks.

    Raises:
        SyntaxError: it does not parse (and what else the compiler raises).
    """
    if "\0" in source:
        raise SyntaxError("source code cannot contain null characters", (PROGRAM, 1, 1, None))
    tree = ast.parse(source, PROGRAM)
    nodes = list(ast.walk(tree))
    if lowercase:
        lower_literals(nodes)
    for node in nodes:
        add_ticks(node)
    return compile(tree, PROGRAM, "exec", dont_inherit=True)


def lower_literals(nodes: list[ast.AST]) -> None:
    """Lower all texts that stand in the program, but not the format specifications of f-strings."""
    specifications = {
        id(part)
        for node in nodes
        if isinstance(node, ast.FormattedValue) and isinstance(node.format_spec, ast.JoinedStr)
        for part in node.format_spec.values
    }
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in specifications:
            node.value = node.value.lower()


def add_ticks(node: ast.AST) -> None:
    """Count a node's turns or entries: a tick at the head of what it runs again."""
    match node:
        case ast.FunctionDef() | ast.AsyncFunctionDef():
            head = [call(TICK, node.body[0])]
            if node.name == "task_program":
                head.append(call(ENTER, node.body[0]))
            at = 1 if ast.get_docstring(node, clean=False) is not None else 0
            node.body[at:at] = head
        case ast.For() | ast.AsyncFor() | ast.While() | ast.ExceptHandler():
            node.body.insert(0, call(TICK, node.body[0]))
        case ast.Try() | ast.TryStar():
            if node.finalbody:
                node.finalbody.insert(0, call(TICK, node.finalbody[0]))
        case ast.Lambda():
            tick = call(TICK, node.body).value
            node.body = ast.copy_location(ast.BoolOp(ast.Or(), [tick, node.body]), node.body)
        case ast.comprehension():
            tick = call(TICK, node.iter).value
            node.ifs.insert(0, ast.copy_location(ast.UnaryOp(ast.Not(), tick), node.iter))


def call(name: str, where: ast.AST) -> ast.Expr:
    """The statement `name()`, said to stand where another node stands."""
    function = ast.copy_location(ast.Name(name, ast.Load()), where)
    return ast.copy_location(ast.Expr(ast.copy_location(ast.Call(function, [], []), where)), where)


class Run:
    """One run of one program: its budget, its clock and its line to the engine.

    Args:
        job: what the engine sent: source, literals, skills, ticks, clock.
    """

    def __init__(self, job: dict[str, Any]) -> None:
        self.job = job
        self.now = 0.0
        self.spent = False
        self.entered = False

    def execute(self) -> dict[str, object]:
        """Run the program to its end and say how it ended."""
        namespace = types.ModuleType("__main__")
        for name, function in self.names().items():
            setattr(namespace, name, function)
        sys.modules["__main__"] = namespace
        setattr(builtins, TICK, self.ticker())
        setattr(builtins, ENTER, self.enter)
        try:
            code = prepared(self.job["source"], lowercase=self.job["literals"] == "lowercase")
            exec(code, namespace.__dict__)  # noqa: S102 - this is what the sandbox is for
            if not self.entered:
                exec("task_program()", namespace.__dict__)  # noqa: S102 - the same
        except BaseException as error:  # noqa: BLE001 - whatever ends a program is an outcome
            return self.ended_by(error)
        return {"end": "timeout", "line": None} if self.spent else {"end": "finished"}

    def ended_by(self, error: BaseException) -> dict[str, object]:
        """Describe what ended the program."""
        line = last_line(error)
        if self.spent or isinstance(error, BudgetSpentError):
            return {"end": "timeout", "line": line}
        if isinstance(error, SystemExit) and (error.code is None or error.code == 0):
            return {"end": "finished"}
        if isinstance(error, RobotError) and error.number >= 0:
            return {"end": "robot-error", "number": error.number, "line": line}
        if isinstance(error, SyntaxError) and line is None:
            line = error.lineno
        return {
            "end": "python-error",
            "kind": type.__getattribute__(type(error), "__name__")[:100],
            "message": message_of(error)[:1000],
            "line": line,
        }

    def enter(self) -> None:
        """Note that the program has started `task_program` by itself."""
        self.entered = True

    def ticker(self) -> Callable[[], None]:
        """The function that counts ticks and, once they are spent, raises each time it is called."""
        count = itertools.count(1).__next__
        limit = self.job["ticks"]

        def tick() -> None:
            if count() > limit or self.spent:
                self.spent = True
                raise BudgetSpentError

        return tick

    def names(self) -> dict[str, object]:
        """What a program can use without an import: the skills, and `sys` and `time`."""
        return {name: self.skill(name, parameters) for name, parameters in self.job["skills"]} | {
            "sys": sys,
            "time": sys.modules["time"],
        }

    def skill(self, name: str, parameters: list[list[str]]) -> object:
        """A function with a skill's name and parameters that asks the engine."""
        names = ", ".join(parameter for parameter, _ in parameters)
        arguments = "".join(f"{parameter}, " for parameter, _ in parameters)
        types_: list[tuple[str, type]] = [
            (parameter, list if kind == "list" else str) for parameter, kind in parameters
        ]
        scope = {"perform": lambda *values: self.perform(name, types_, values)}
        exec(f"def {name}({names}): return perform({arguments})", scope)  # noqa: S102 - of trusted text
        return scope[name]

    def perform(self, name: str, parameters: list[tuple[str, type]], values: tuple[Any, ...]) -> Any:  # noqa: ANN401
        """Ask the engine for a skill; texts must be `str` and options a `list`, exactly."""
        arguments: list[object] = []
        options: list[Any] = []
        for (parameter, kind), value in zip(parameters, values, strict=True):
            given: type = type(value)
            if given is not kind:
                wanted = "a list" if kind is list else "text"
                raise TypeError(f"{name}: {parameter} must be {wanted}, not {given.__name__}")
            if kind is list:
                options = list(value)
                arguments.append([[str(option), isinstance(option, str)] for option in options])
            else:
                arguments.append(value)
        result = self.request([name, arguments])
        return options[result] if options and isinstance(result, int) else result

    def sleep(self, seconds: object, /) -> None:
        """Let simulated time pass; the engine hears of it with the next request, or when the time is up."""
        if not isinstance(seconds, int | float):
            raise TypeError(f"{type(seconds).__name__!r} object cannot be interpreted as an integer")
        if not 0 <= seconds < float("inf"):
            raise ValueError("sleep length must be non-negative and finite")
        self.now += seconds
        if self.now > self.job["seconds"]:
            self.request(["sleep", []])

    def request(self, message: list[object]) -> Any:  # noqa: ANN401 - what a skill returns
        """Send one request with the time at which it is made, and wait for its reply."""
        if self.spent:
            raise BudgetSpentError
        send([*message, self.now])
        kind, value = receive()
        if kind == "ok":
            return value
        if kind == "error":
            number, name, text = value
            error = type(name, (RobotError,), {"__module__": "robot"})(text)
            error.number = number
            raise error
        self.spent = True
        raise BudgetSpentError


def last_line(error: BaseException) -> int | None:
    """The line of the program at which an exception arose."""
    line, traceback = None, error.__traceback__
    while traceback is not None:
        if traceback.tb_frame.f_code.co_filename == PROGRAM:
            line = traceback.tb_lineno
        traceback = traceback.tb_next
    return line


def message_of(error: BaseException) -> str:
    """What an exception says; its class may be the program's own."""
    if isinstance(error, SyntaxError) and error.filename == PROGRAM and isinstance(error.msg, str):
        return error.msg  # without the place, which is said beside it
    try:
        return str.__str__(str(error))
    except BaseException:  # noqa: BLE001 - the program's own __str__ may raise anything
        return ""


# --- the line to the engine


def send(message: object) -> None:
    """Write one frame: four bytes of length, then JSON."""
    data = json.dumps(message).encode()
    if len(data) > MAX_FRAME:
        data = b'["too-long", [], 0.0]'
    view = memoryview(struct.pack(">I", len(data)) + data)
    while view:
        view = view[os.write(CHANNEL, view) :]


def receive() -> Any:  # noqa: ANN401 - JSON
    """Read one frame."""
    data = b""
    while len(data) < HEADER or len(data) < HEADER + int.from_bytes(data[:HEADER], "big"):
        piece = os.read(CHANNEL, 1 << 16)
        if not piece:
            os._exit(1)
        data += piece
    return json.loads(data[HEADER:])


# --- what the program sees of the world outside: a simulated clock, fixed chance, no input and no output


def simulate_surroundings(run: Run) -> None:
    """Give the program a clock of the engine's, chance that repeats, an empty input, a deaf output."""
    simulate_time(run)
    simulate_chance()
    sys.stdin = io.StringIO("")
    sys.stdout = sys.stderr = io.TextIOWrapper(Nowhere(), encoding="utf-8", errors="replace")
    sys.argv = ["program"]
    os.getpid = lambda: 1
    site.setquit()
    sys.setrecursionlimit(RECURSION_LIMIT)


class Nowhere(io.BufferedIOBase):
    """An output that forgets."""

    def writable(self) -> bool:
        """Accept everything."""
        return True

    def write(self, data: Any, /) -> int:  # noqa: ANN401 - any buffer
        """Forget it."""
        return len(data)


def simulate_time(run: Run) -> None:
    """Let `time` and `datetime` read the engine's clock."""
    import datetime as real  # noqa: ICN001, PLC0415 - the module is changed, not used
    import time  # noqa: PLC0415 - the same

    start = run.job["clock"]
    for name in ("time", "monotonic", "perf_counter", "process_time", "thread_time"):
        origin = start if name == "time" else 0.0
        setattr(time, name, lambda origin=origin: origin + run.now)
        setattr(time, name + "_ns", lambda origin=origin: int((origin + run.now) * 1e9))
    time.sleep = run.sleep
    localtime, gmtime, strftime, asctime = time.localtime, time.gmtime, time.strftime, time.asctime

    def or_now(given: tuple[Any, ...]) -> tuple[Any, ...]:
        return given if given and given[0] is not None else (time.time(),)

    time.gmtime = lambda *seconds: gmtime(*or_now(seconds))
    time.localtime = lambda *seconds: localtime(*or_now(seconds))
    time.strftime = lambda form, *when: strftime(form, *(when or [time.localtime()]))
    time.asctime = lambda *when: asctime(*(when or [time.localtime()]))
    time.ctime = lambda *seconds: asctime(time.localtime(*seconds))

    class date(real.date):  # noqa: N801 - it takes the place of the real one
        @classmethod
        def today(cls) -> date:
            return cls.fromtimestamp(time.time())

    class datetime(real.datetime):  # noqa: N801 - the same
        @classmethod
        def now(cls, tz: real.tzinfo | None = None) -> datetime:
            return cls.fromtimestamp(time.time(), tz)

        @classmethod
        def utcnow(cls) -> datetime:
            return cls.fromtimestamp(time.time())

        @classmethod
        def today(cls) -> datetime:
            return cls.fromtimestamp(time.time())

    for fake in (date, datetime):
        fake.__module__, fake.__qualname__ = "datetime", fake.__name__
        setattr(real, fake.__name__, fake)


def simulate_chance() -> None:
    """Let `random` repeat, also where a program asks for an unpredictable seed."""
    import random  # noqa: PLC0415 - the module is changed, not used

    class Random(random.Random):
        def seed(self, a: Any = None, version: int = 2) -> None:  # noqa: ANN401 - as in random
            super().seed(0 if a is None else a, version)

    fixed = Random()
    for name in random.__all__:
        if name not in ("Random", "SystemRandom"):
            setattr(random, name, getattr(fixed, name))
    random.Random = Random  # type: ignore[misc]  # programs get the one that repeats


# --- the walls


def enclose(job: dict[str, Any], seccomp: ctypes.Array[ctypes.c_char] | None) -> None:
    """Close everything but the channel and give up every right, in the only order that works."""
    for name in ("CORE", "FSIZE", "NPROC", "MEMLOCK", "MSGQUEUE"):
        resource.setrlimit(getattr(resource, "RLIMIT_" + name), (0, 0))
    resource.setrlimit(resource.RLIMIT_NOFILE, (4, 4))
    resource.setrlimit(resource.RLIMIT_AS, (job["memory"], job["memory"]))
    resource.setrlimit(resource.RLIMIT_CPU, (job["cpu"], job["cpu"] + 1))
    if os.geteuid() == 0:
        os.setgroups([])
        os.setresgid(NOBODY, NOBODY, NOBODY)
        os.setresuid(NOBODY, NOBODY, NOBODY)
    prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    prctl(PR_SET_DUMPABLE, 0)
    prctl(PR_SET_NO_NEW_PRIVS, 1)
    if seccomp is not None:
        prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, ctypes.addressof(seccomp))


NOBODY = 65534
PR_SET_PDEATHSIG, PR_SET_DUMPABLE, PR_SET_SECCOMP, PR_SET_NO_NEW_PRIVS = 1, 4, 22, 38
SECCOMP_MODE_FILTER = 2
ADDR_NO_RANDOMIZE = 0x0040000
LIBC = ctypes.CDLL(None, use_errno=True)


def prctl(option: int, *values: int) -> None:
    """Ask the kernel to change what this process may do."""
    arguments = [ctypes.c_ulong(value) for value in (*values, 0, 0, 0, 0)[:4]]
    if LIBC.prctl(ctypes.c_int(option), *arguments) != 0:
        raise OSError(ctypes.get_errno(), f"prctl({option}) failed")


SYSCALLS = {
    "x86_64": (
        0xC000003E,
        {"read": 0, "write": 1, "mmap": 9, "mprotect": 10, "munmap": 11, "brk": 12, "rt_sigreturn": 15,
         "sched_yield": 24, "mremap": 25, "madvise": 28, "getpid": 39, "exit": 60, "gettimeofday": 96,
         "futex": 202, "restart_syscall": 219, "clock_gettime": 228, "exit_group": 231},
    ),
    "aarch64": (
        0xC00000B7,
        {"read": 63, "write": 64, "mmap": 222, "mprotect": 226, "munmap": 215, "brk": 214,
         "rt_sigreturn": 139, "sched_yield": 124, "mremap": 216, "madvise": 233, "getpid": 172, "exit": 93,
         "gettimeofday": 169, "futex": 98, "restart_syscall": 128, "clock_gettime": 113, "exit_group": 94},
    ),
}  # fmt: skip
LOAD, RETURN, EQUAL, AT_LEAST, ANY_BIT = 0x20, 0x06, 0x15, 0x35, 0x45
ALLOW, DENY, KILL = 0x7FFF0000, 0x00050001, 0x80000000
NUMBER, ARCHITECTURE, FIRST_ARGUMENT, THIRD_ARGUMENT = 0, 4, 16, 32
X32 = 0x40000000
PROT_EXEC = 4


def seccomp_filter(machine: str) -> ctypes.Array[ctypes.c_char] | None:
    """The list of what a child may ask of the kernel, as a BPF program; None on an unknown machine.

    Reading and writing go to the channel only, memory is never executable; all else is refused with EPERM.
    """
    if machine not in SYSCALLS or not sys.platform.startswith("linux"):
        return None
    architecture, numbers = SYSCALLS[machine]
    guarded = {
        **dict.fromkeys(("read", "write"), (FIRST_ARGUMENT, (EQUAL, 0, 1, CHANNEL))),
        **dict.fromkeys(("mmap", "mprotect"), (THIRD_ARGUMENT, (ANY_BIT, 1, 0, PROT_EXEC))),
    }
    code = [
        (LOAD, 0, 0, ARCHITECTURE),
        (EQUAL, 1, 0, architecture),
        (RETURN, 0, 0, KILL),
        (LOAD, 0, 0, NUMBER),
        (AT_LEAST, 0, 1, X32),
        (RETURN, 0, 0, KILL),
    ]
    for name, number in numbers.items():
        if name not in guarded:
            code += [(EQUAL, 0, 1, number), (RETURN, 0, 0, ALLOW)]
    for name, (argument, test) in guarded.items():
        body = [(LOAD, 0, 0, argument), test, (RETURN, 0, 0, ALLOW), (RETURN, 0, 0, DENY)]
        code += [(EQUAL, 0, len(body), numbers[name]), *body]
    code.append((RETURN, 0, 0, DENY))
    instructions = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *line) for line in code))
    header = ctypes.create_string_buffer(struct.pack("HxxxxxxP", len(code), ctypes.addressof(instructions)))
    header.instructions = instructions  # type: ignore[attr-defined]  # keeps them alive
    return header


def can_install(seccomp: ctypes.Array[ctypes.c_char]) -> bool:
    """Whether the kernel takes the filter here, which a container may forbid; tried in another process."""
    pid = os.fork()
    if pid == 0:
        try:
            prctl(PR_SET_NO_NEW_PRIVS, 1)
            prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, ctypes.addressof(seccomp))
        except OSError:
            os._exit(1)
        os._exit(0)
    return os.waitpid(pid, 0)[1] == 0


# --- the zygote


def child(door: socket.socket, seccomp: ctypes.Array[ctypes.c_char] | None) -> NoReturn:
    """Be the child of one run: take the channel, close the walls, run the program, say how it ended."""
    descriptors = socket.recv_fds(door, 1, 1)[1]
    os.dup2(descriptors[0], CHANNEL)
    os.closerange(CHANNEL + 1, 256)
    job = receive()
    enclose(job, seccomp)
    send("ready")
    run = Run(job)
    simulate_surroundings(run)
    send(run.execute())
    os._exit(0)


def one_run(door: socket.socket, seccomp: ctypes.Array[ctypes.c_char] | None) -> bool:
    """Fork the child of one run and report its process id and, at its end, its wait status.

    The dead child is reaped only when the next run is asked for, so that until then its id stays its own. All
    that is allocated here is freed on return, so that every child starts from the same heap.
    """
    if not os.read(WAKE, 1):
        return False
    with contextlib.suppress(ChildProcessError):
        os.waitpid(-1, 0)
    pid = os.fork()
    if pid == 0:
        try:
            child(door, seccomp)
        finally:
            os._exit(1)
    os.write(REPORT, struct.pack("=q", pid))
    watch = os.pidfd_open(pid)
    if watch not in select.select([watch, WAKE], [], [])[0]:
        os.kill(pid, signal.SIGKILL)  # the engine is gone
    os.close(watch)
    ended = os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
    status = 0 if ended is None else ended.si_status if ended.si_code == os.CLD_EXITED else -ended.si_status
    os.write(REPORT, struct.pack("=q", status))
    return True


def zygote() -> None:
    """Serve runs, one at a time, until the engine closes its end.

    All that a program may import is imported here: the walls allow no file to be opened later.
    """
    for name in PRELOADED:
        importlib.import_module(name)
    seccomp = seccomp_filter(platform.machine())
    if seccomp is not None and not can_install(seccomp):
        seccomp = None
    entrance = socket.socket(fileno=DOOR)
    gc.collect()
    gc.freeze()
    os.write(REPORT, struct.pack("=q", 0 if seccomp is None else 1))
    while one_run(entrance, seccomp):
        pass


def start_again(wake: int, door: int, report: int) -> NoReturn:
    """Become the zygote, with what the engine handed over at fixed numbers and with fixed addresses.

    A program may say an address. It must be the same in every start, and even the lengths of arguments and
    the numbers of descriptors would move it.
    """
    copies = [fcntl.fcntl(descriptor, fcntl.F_DUPFD, REPORT + 1) for descriptor in (wake, door, report)]
    for copy, number in zip(copies, (WAKE, DOOR, REPORT), strict=True):
        os.dup2(copy, number, inheritable=True)
    os.closerange(REPORT + 1, 65536)
    LIBC.personality(ctypes.c_ulong(ADDR_NO_RANDOMIZE))
    os.execv(sys.executable, [sys.executable, *FLAGS, __file__])  # noqa: S606 - the same program again


def main(arguments: list[str]) -> None:
    """Start, at first only to start again."""
    if arguments:
        start_again(*map(int, arguments))
    zygote()


FLAGS = ("-S", "-s", "-P", "-B")


if __name__ == "__main__":
    main(sys.argv[1:])
