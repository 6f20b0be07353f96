"""Each layer of isolation stops its deeds without the other layers, and without it they succeed."""

import json
import os
import platform
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from codebotler.simulator.sandbox import isolation

SCRIPT = """
import ctypes, errno, os, platform, resource, select, signal, socket, tempfile, time
from codebotler.simulator.sandbox import isolation
os.dup2(1, 3)
libc = ctypes.CDLL(None, use_errno=True)
libc.mmap.restype = ctypes.c_ssize_t
libc.mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_size_t]
libc.mprotect.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
READABLE, WRITABLE, EXECUTABLE, PRIVATE = 1, 2, 4, 0x22

def tell(word):
    os.write(3, word.encode())

def succeed(result):
    if result == -1:
        raise OSError(ctypes.get_errno(), "refused")
    return result

def only_seccomp():
    isolation.refuse_new_rights()  # an ordinary user may install no list without it
    isolation.install(isolation.seccomp_filter(platform.machine()))

def limit(name):
    isolation.set_limit(name, dict(AS=512 * 1024**2, NOFILE=4).get(name, 0))

{before}
try:
    {layer}
    {deed}
    tell("done")
except OSError as error:
    tell(errno.errorcode[error.errno])
os._exit(0)
"""


FORKING = f"""
import json, os, sys, traceback
{SCRIPT.split("from codebotler", maxsplit=1)[0]}
from codebotler.simulator.sandbox import isolation
for line in sys.stdin:
    script, folder = json.loads(line)
    reader, writer = os.pipe()
    if (child := os.fork()) == 0:
        os.close(reader)
        os.dup2(writer, 1)
        os.dup2(writer, 2)
        os.close(writer)
        os.chdir(folder)
        try:
            exec(script)
        except BaseException:
            os.write(2, traceback.format_exc().encode())
        os._exit(1)
    os.close(writer)
    with open(reader) as output:
        told = output.read()
    print(json.dumps([os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), told]), flush=True)
"""
"""Fork a process for each script, which takes a tenth of the time of starting one."""


def indent(code: str) -> str:
    return code.strip().replace("\n", "\n    ")


@cache
def fork_server() -> subprocess.Popen[str]:
    """Start the process from which scripts are forked."""
    return subprocess.Popen(
        [sys.executable, "-B", "-c", FORKING], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )


@pytest.fixture(autouse=True, scope="module")
def end_fork_server() -> Iterator[None]:
    yield
    with fork_server():
        fork_server().kill()
    fork_server.cache_clear()


def run_behind(layer: str, deed: str, before: str, folder: str = "/") -> str:
    """Run a deed behind a layer; return the output of the process, or the signal that ended it."""
    script = SCRIPT.format(before=before, layer=layer, deed=indent(deed))
    server = fork_server()
    assert server.stdin is not None
    assert server.stdout is not None
    server.stdin.write(json.dumps([script, folder]) + "\n")
    server.stdin.flush()
    status, output = json.loads(server.stdout.readline())
    if status < 0:
        return signal.Signals(-status).name
    return f"{output.strip()} {status or ''}".strip()


@dataclass(frozen=True)
class Deed:
    """An action of a process, and its result behind one layer.

    Args:
        layer: the code that sets up the layer.
        deed: the code of the action.
        comes_to: the result: `done`, or the name of an error or of the signal that ended the process.
        before: the code that runs first, with and without the layer.
        bare: the result without the layer.
    """

    layer: str
    deed: str
    result: str
    before: str = ""
    bare: str = "done"


A_PAGE = "page = succeed(libc.mmap(None, 4096, READABLE | WRITABLE, PRIVATE, -1, 0))"
A_PIPE = "reader, writer = os.pipe(); os.write(writer, b'x')"
A_FILE = "file = tempfile.TemporaryFile()"
NOBODY = "isolation.become_nobody()"
AN_ORPHAN = """
reader, writer = os.pipe()
parent = os.getpid()
if os.fork():
    os._exit(len(os.read(reader, 1)) - 1)
"""
OUTLIVE_PARENT = "os.write(writer, b'x')\ntime.sleep(0.7)"
BECOME_VISIBLE = (
    "isolation.become_nobody(); isolation.prctl(isolation.PR_SET_DUMPABLE, 1)"  # the change of user hid it
)
LOOK = """
target = os.getpid()
looker = os.fork()
if looker == 0:
    try:
        open(f"/proc/{target}/environ", "rb").read()
    except OSError as error:
        os._exit(error.errno)
    os._exit(0)
if seen := os.waitstatus_to_exitcode(os.waitpid(looker, 0)[1]):
    raise OSError(seen, "refused")
"""
A_SHORT_WAIT = """
word, a_moment = (ctypes.c_int * 1)(), (ctypes.c_long * 2)(0, 1_000_000)
futex = dict(x86_64=202, aarch64=98).get(platform.machine())
"""
A_QUEUE = "succeed(libc.mq_open(b'/layers', os.O_CREAT | os.O_RDWR, 0o600, None))\nlibc.mq_unlink(b'/layers')"
DUMP = """
dumper = os.fork()
if dumper == 0:
    os.abort()
if not os.WCOREDUMP(os.waitpid(dumper, 0)[1]):
    raise OSError(errno.EPERM, "refused")
"""


def deny(deed: str, before: str = "") -> Deed:
    """Return a deed that the list of system calls refuses."""
    return Deed("only_seccomp()", deed, "EPERM", before)


def allow(deed: str, before: str = "", result: str = "done") -> Deed:
    """Return a deed that the list of system calls allows."""
    return Deed("only_seccomp()", deed, result, before, bare=result)


DEEDS = {
    "seccomp: socket": deny("socket.socket()"),
    "seccomp: pair of sockets": deny("socket.socketpair()"),
    "seccomp: open": deny("os.open('/dev/null', os.O_RDONLY)"),
    "seccomp: stat": deny("os.stat('/')"),
    "seccomp: truncate": deny("os.ftruncate(file.fileno(), 0)", A_FILE),
    "seccomp: fork": deny("os.fork() or os._exit(0)"),
    "seccomp: exec": deny("os.execv('/bin/sh', ['sh', '-c', 'echo done'])"),
    "seccomp: ptrace": deny("succeed(libc.ptrace(0, 0, 0, 0))"),
    "seccomp: kill": deny("os.kill(os.getpid(), 0)"),
    "seccomp: signal handler": deny("signal.signal(signal.SIGTERM, signal.SIG_IGN)"),
    "seccomp: timer": deny("signal.setitimer(signal.ITIMER_REAL, 100)"),
    "seccomp: wait": deny("select.select([], [], [], 0)"),
    "seccomp: user": deny("os.setuid(os.getuid())"),
    "seccomp: prctl": deny("isolation.prctl(isolation.PR_SET_DUMPABLE, 0)"),
    "seccomp: limit": deny("succeed(libc.setrlimit(4, bytes(16)))"),
    "seccomp: true chance": deny("os.getrandom(1)"),
    "seccomp: descriptor": deny("os.dup(3)"),
    "seccomp: read elsewhere": deny("os.read(reader, 1)", A_PIPE),
    "seccomp: write elsewhere": deny("os.write(writer, b'x')", A_PIPE),
    "seccomp: executable memory": deny("succeed(libc.mmap(None, 4096, EXECUTABLE, PRIVATE, -1, 0))"),
    "seccomp: memory made executable": deny("succeed(libc.mprotect(page, 4096, EXECUTABLE))", A_PAGE),
    "seccomp: wait for a futex": Deed(
        "only_seccomp()",
        "succeed(libc.syscall(futex, word, 0, 0, a_moment))",
        "EPERM",
        A_SHORT_WAIT,
        bare="ETIMEDOUT",
    ),
    "seccomp: wake by a futex": allow("succeed(libc.pthread_once(word, libc.getpid))", A_SHORT_WAIT),
    "seccomp: memory": allow(A_PAGE),
    "seccomp: memory made read-only": allow("succeed(libc.mprotect(page, 4096, READABLE))", A_PAGE),
    "seccomp: read on the channel": allow("os.read(3, 1)", result="EBADF"),  # this channel is write-only
    "seccomp: clock": allow("time.time()"),
    "FSIZE": Deed("limit('FSIZE')", "os.write(file.fileno(), b'x')", "EFBIG", A_FILE),
    "NOFILE": Deed("limit('NOFILE')", "os.open('/dev/null', os.O_RDONLY)", "EMFILE"),
    "NPROC": Deed("limit('NPROC')", "os.fork() or os._exit(0)", "EAGAIN", NOBODY),
    "MEMLOCK": Deed(
        "limit('MEMLOCK')", "succeed(libc.mlock(ctypes.c_void_p(page), 4096))", "EPERM", f"{NOBODY}; {A_PAGE}"
    ),
    "MSGQUEUE": Deed("limit('MSGQUEUE')", A_QUEUE, "EMFILE", NOBODY),
    "AS": Deed("limit('AS')", "succeed(libc.mmap(None, 10**9, READABLE, PRIVATE, -1, 0))", "ENOMEM"),
    "CPU": Deed("isolation.limit_time(1)", "while time.process_time() < 1.1: pass", "SIGXCPU"),
    "death with the parent": Deed("isolation.die_with_parent()", OUTLIVE_PARENT, "", AN_ORPHAN),
    "hidden memory": Deed("isolation.prctl(isolation.PR_SET_DUMPABLE, 0)", LOOK, "EACCES", BECOME_VISIBLE),
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name == "CPU")) for name in DEEDS]
)
def test_layer_holds_by_itself(name: str) -> None:
    case = DEEDS[name]
    assert run_behind("pass", case.deed, case.before) == case.bare
    assert run_behind(case.layer, case.deed, case.before) == case.result


# --- rights of root


@pytest.fixture(scope="module")
def folder() -> Iterator[str]:
    """Yield a folder that everybody may enter, with a file of root and a setuid-root program."""
    path = Path(tempfile.mkdtemp(prefix="layers-"))
    path.chmod(0o755)
    (path / "secret").touch(0o600)
    shutil.copyfile(shutil.which("id") or "", path / "id")
    (path / "id").chmod(0o4755)
    yield str(path)
    shutil.rmtree(path)


ROOTS_DEEDS = {
    "another user reads": Deed(NOBODY, "open('secret')", "EACCES"),
    "another user kills": Deed(NOBODY, "os.kill(os.getppid(), 0)", "EPERM"),
    "another user comes back": Deed(NOBODY, "os.setresuid(0, 0, 0)", "EPERM"),
    "another user keeps a group": Deed(
        NOBODY,
        "if 7 in os.getgroups(): tell('a member, ')",
        "done",
        "os.setgroups([7])",
        bare="a member, done",
    ),
    "another user joins a group": Deed(NOBODY, "os.setgroups([0])", "EPERM"),
    "another group comes back": Deed(NOBODY, "os.setresgid(0, 0, 0)", "EPERM"),
    "no new rights": Deed(
        "isolation.refuse_new_rights()",
        "os.execv('./id', ['id', '-u'])",
        str(isolation.NOBODY),
        NOBODY,
        bare="0",
    ),
    "dumps of memory": Deed(
        "limit('CORE')", DUMP, "EPERM", "resource.setrlimit(resource.RLIMIT_CORE, (-1, -1))"
    ),
}


@pytest.mark.skipif(os.geteuid() != 0, reason="only root has these rights to lose")
@pytest.mark.parametrize("name", ROOTS_DEEDS)
def test_layer_holds_root_by_itself(folder: str, name: str) -> None:
    case = ROOTS_DEEDS[name]
    bare = run_behind("pass", case.deed, case.before, folder)
    if bare != case.bare and name in ("no new rights", "dumps of memory"):
        pytest.skip(f"this machine does not allow the deed to anybody ({bare})")
    assert bare == case.bare
    assert run_behind(case.layer, case.deed, case.before, folder) == case.result


# --- other ways into the kernel

OLD_CALLS = """
page = succeed(libc.mmap(None, 4096, READABLE | WRITABLE | EXECUTABLE, PRIVATE, -1, 0))
ctypes.memmove(page, bytes.fromhex("b814000000cd80c3"), 8)  # mov eax, 20; int 0x80; ret
"""


@pytest.mark.skipif(
    platform.machine() != "x86_64", reason="only this kind of machine has other tables of calls"
)
def test_call_by_the_table_of_another_architecture_ends_the_process() -> None:
    call = "ctypes.CFUNCTYPE(ctypes.c_int)(page)()"
    if (bare := run_behind("pass", call, OLD_CALLS)) != "done":
        pytest.skip(f"this kernel has no 32-bit calls ({bare})")
    assert run_behind("only_seccomp()", call, OLD_CALLS) == "SIGSYS"


def test_call_by_an_x32_number_ends_the_process() -> None:
    call = "libc.syscall(0x40000000 + 39)"
    assert run_behind("pass", call, "") == "done"
    assert run_behind("only_seccomp()", call, "") == "SIGSYS"


MACHINE = platform.machine()
ON_THE_LIST = set(isolation.SYSCALLS[MACHINE][1].values()) if MACHINE in isolation.SYSCALLS else set()
OUTSIDE_LISTS = {335: "SIGILL", 336: "ENXIO"} if MACHINE == "x86_64" else {}  # the results of newer kernels
HIGHEST = 700  # no kernel has as many system calls
CALL = "libc.syscall(ctypes.c_long(number), 0, 0, 0, 0, 0, 0)"
EACH_REFUSED = f"""
for number in {{}}:
    if {CALL} != -1 or ctypes.get_errno() != errno.EPERM:
        tell(f"{{{{number}}}} ")
"""
EACH_ENDS_ITS_PROCESS = f"""
for number in {{}}:
    if os.fork() == 0:
        only_seccomp()
        {CALL}
        os._exit(0)
    if os.WTERMSIG(os.wait()[1]) != signal.SIGSYS:
        tell(f"{{{{number}}}} ")
"""
one_list = pytest.mark.skipif(MACHINE not in isolation.SYSCALLS, reason="this kind of machine has no list")


@one_list
def test_unlisted_system_calls_are_refused() -> None:
    numbers = {*range(HIGHEST), isolation.X32 - 1, 2**32 + 2} - ON_THE_LIST - OUTSIDE_LISTS.keys()
    assert run_behind("only_seccomp()", EACH_REFUSED.format(sorted(numbers)), NOBODY) == "done"


@pytest.mark.slow
@one_list
def test_every_number_of_another_interface_ends_the_process() -> None:
    numbers = [*range(isolation.X32, isolation.X32 + HIGHEST), 2**31 - 1, 2**31]
    assert run_behind("pass", EACH_ENDS_ITS_PROCESS.format(numbers), f"{NOBODY}; limit('CORE')") == "done"


@pytest.mark.parametrize("number", OUTSIDE_LISTS)
def test_calls_that_newer_kernels_exempt_from_lists_do_nothing(number: int) -> None:
    assert run_behind("only_seccomp()", f"succeed(libc.syscall({number}))", "") in (
        "EPERM",
        OUTSIDE_LISTS[number],
    )


def test_list_of_system_calls_exists_for_two_kinds_of_machines() -> None:
    assert [
        isolation.seccomp_filter(machine) is not None for machine in ("x86_64", "aarch64", "riscv64")
    ] == [
        True,
        True,
        False,
    ]


def test_list_of_system_calls_is_minimal() -> None:
    """Allowing one more call must be a decision, not an oversight."""
    needed = (
        "read write mmap mprotect munmap brk rt_sigreturn sched_yield mremap madvise getpid exit gettimeofday"
    )
    needed += " futex restart_syscall clock_gettime exit_group"
    for _, numbers in isolation.SYSCALLS.values():
        assert sorted(numbers) == sorted(needed.split())
