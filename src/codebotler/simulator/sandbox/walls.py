"""The walls around a child: limits, lost rights, and the list of what it may ask of the kernel."""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import struct
import sys
from typing import Any

from codebotler.simulator.sandbox.channel import CHANNEL


def enclose(job: dict[str, Any], seccomp: ctypes.Array[ctypes.c_char] | None, parent: int) -> None:
    """Close everything but the channel and give up every right, in the only order that works."""
    for name, value in limits(job["memory"], job["cpu"]).items():
        set_limit(name, value)
    become_nobody()
    die_with(parent)
    hide_memory()
    refuse_new_rights()
    if seccomp is not None:
        install(seccomp)


def limits(memory: int, cpu: int) -> dict[str, tuple[int, int]]:
    """The limits of a child by name, each with the one to which a process may raise it.

    Args:
        memory: bytes of address space.
        cpu: seconds of processor time.
    """
    none = dict.fromkeys(("CORE", "FSIZE", "NPROC", "MEMLOCK", "MSGQUEUE"), (0, 0))
    return {**none, "NOFILE": (4, 4), "AS": (memory, memory), "CPU": (cpu, cpu + 1)}


def set_limit(name: str, value: tuple[int, int]) -> None:
    """Set one limit of this process."""
    resource.setrlimit(getattr(resource, "RLIMIT_" + name), value)


def become_nobody() -> None:
    """Give up being root; whoever is not stays who they are."""
    if os.geteuid() == 0:
        os.setgroups([])
        os.setresgid(NOBODY, NOBODY, NOBODY)
        os.setresuid(NOBODY, NOBODY, NOBODY)


def die_with(parent: int) -> None:
    """Be killed when the parent ends; a change of user would undo this."""
    prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it died before that: no signal will come
        os._exit(1)


def hide_memory() -> None:
    """Keep other processes of the same user from tracing this one and from reading its memory."""
    prctl(PR_SET_DUMPABLE, 0)


def refuse_new_rights() -> None:
    """Never get rights from a program that carries them, such as a setuid one."""
    prctl(PR_SET_NO_NEW_PRIVS, 1)


def install(seccomp: ctypes.Array[ctypes.c_char]) -> None:
    """Ask nothing more of the kernel than the list allows."""
    prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, ctypes.addressof(seccomp))


NOBODY = 65534
PR_SET_PDEATHSIG, PR_SET_DUMPABLE, PR_SET_SECCOMP, PR_SET_NO_NEW_PRIVS = 1, 4, 22, 38
SECCOMP_MODE_FILTER = 2
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
            refuse_new_rights()
            install(seccomp)
        except OSError:
            os._exit(1)
        os._exit(0)
    return os.waitpid(pid, 0)[1] == 0
