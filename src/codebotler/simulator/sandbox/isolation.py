"""Isolates processes with the kernel: resource limits, dropped privileges and a seccomp filter."""

from __future__ import annotations

import _ctypes
import os
import resource
import sys

from codebotler.simulator.sandbox import CHANNEL, MEMORY

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import TypeAlias

    Filter: TypeAlias = tuple[bytes, bytes]  # a `struct sock_fprog`, and the BPF code it points to


def give_up_rights(memory: int = MEMORY) -> None:
    """Permanently drop this process's privileges. `memory` limits its address space, in bytes."""
    for name in ("CORE", "FSIZE", "MEMLOCK", "MSGQUEUE"):
        set_limit(name, 0)
    set_limit("AS", memory)
    become_nobody()
    die_with_parent()
    prctl(PR_SET_DUMPABLE, 0)  # stops other processes of the user from tracing it or reading its memory
    refuse_new_rights()


def enclose(seccomp: Filter | None, seconds: int) -> None:
    """Forbid new processes and files, limit processor time, apply `seccomp`. Call `give_up_rights` first."""
    set_limit("NPROC", 0)
    set_limit("NOFILE", CHANNEL + 1)
    limit_time(seconds)
    if seccomp is not None:
        install(seccomp)


def set_limit(name: str, value: int) -> None:
    """Permanently set a resource limit, such as NOFILE. Outside Linux, ignore limits that are refused."""
    kind = getattr(resource, "RLIMIT_" + name, None)
    try:
        if kind is not None:
            resource.setrlimit(kind, (value, value))
    except (ValueError, OSError):
        if sys.platform == "linux":
            raise


def limit_time(seconds: int) -> None:
    """Limit processor time: SIGXCPU ends this process at the limit, or SIGKILL a second later."""
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))


def become_nobody() -> None:
    """If this process is root, become the user nobody, since the limit of processes exempts root."""
    if os.geteuid() != 0:
        return
    os.setgroups([])
    if sys.platform == "linux":
        os.setresgid(NOBODY, NOBODY, NOBODY)
        os.setresuid(NOBODY, NOBODY, NOBODY)
    else:
        os.setregid(NOBODY, NOBODY)
        os.setreuid(NOBODY, NOBODY)


def die_with_parent() -> None:
    """Let the kernel kill this process when the thread that started it ends. A new user ID undoes this."""
    prctl(PR_SET_PDEATHSIG, SIGKILL)


def refuse_new_rights() -> None:
    """Prevent this process from gaining privileges when it executes another program, such as sudo."""
    prctl(PR_SET_NO_NEW_PRIVS, 1)


def install(seccomp: Filter) -> None:
    """Install a filter, after which only the system calls that it lists are allowed."""
    prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, seccomp[0])


NOBODY = 65534
SIGKILL = 9
PR_SET_PDEATHSIG, PR_SET_DUMPABLE, PR_SET_SECCOMP, PR_SET_NO_NEW_PRIVS = 1, 4, 22, 38
MACHINE = os.uname().machine
SECCOMP_MODE_FILTER = 2
LIBC = _ctypes.dlopen(None, 0)  # type: ignore[arg-type]  # instead of `ctypes`, which is large and would slow down each fork


def prctl(option: int, value: int = 0, other: int | bytes = 0) -> None:
    """Change an attribute of this process on Linux, and do nothing on other systems."""
    if sys.platform != "linux":
        return
    if _ctypes.call_function(_ctypes.dlsym(LIBC, "prctl"), (option, value, other, 0, 0)) != 0:
        raise PermissionError(1, f"the kernel refused prctl({option})")


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
SYSCALL_NUMBER, ARCHITECTURE, FIRST_ARGUMENT, SECOND_ARGUMENT, THIRD_ARGUMENT = 0, 4, 16, 24, 32
X32 = 0x40000000
PROT_EXEC = 4
FUTEX_WAKE_PRIVATE = 129


def seccomp_filter(machine: str = MACHINE) -> Filter | None:
    """Return a BPF program with a child's allowed system calls, or None on an unsupported architecture.

    Only the channel can be read and written, memory is never executable, and a futex can wake but not wait,
    since no other thread could wake it. All other calls fail with EPERM.
    """
    if machine not in SYSCALLS or sys.platform != "linux":
        return None
    architecture, numbers = SYSCALLS[machine]
    guarded = {
        **dict.fromkeys(("read", "write"), (FIRST_ARGUMENT, (EQUAL, 0, 1, CHANNEL))),
        **dict.fromkeys(("mmap", "mprotect"), (THIRD_ARGUMENT, (ANY_BIT, 1, 0, PROT_EXEC))),
        "futex": (SECOND_ARGUMENT, (EQUAL, 0, 1, FUTEX_WAKE_PRIVATE)),
    }
    code = [  # each instruction: operation, jump if true, jump if false, operand
        (LOAD, 0, 0, ARCHITECTURE),
        (EQUAL, 1, 0, architecture),
        (RETURN, 0, 0, KILL),
        (LOAD, 0, 0, SYSCALL_NUMBER),
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
    instructions = b"".join(
        operation.to_bytes(2, sys.byteorder) + bytes((if_true, if_false)) + operand.to_bytes(4, sys.byteorder)
        for operation, if_true, if_false, operand in code
    )
    address = id(instructions) + bytes.__basicsize__ - 1  # the bytes follow the object's header
    return len(code).to_bytes(8, sys.byteorder) + address.to_bytes(8, sys.byteorder), instructions


def usable_filter() -> Filter | None:
    """Return this machine's seccomp filter, or None if the kernel refuses it, as in some containers."""
    seccomp = seccomp_filter()
    if seccomp is None:
        return None
    pid = os.fork()
    if pid == 0:
        try:
            refuse_new_rights()
            install(seccomp)
        except OSError:
            os._exit(1)
        os._exit(0)
    return seccomp if os.waitpid(pid, 0)[1] == 0 else None
