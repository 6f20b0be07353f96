"""The kernel shows the isolation of the engine's processes while a program runs."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from codebotler.core.skills.paper import SKILLS
from codebotler.core.world import Room, World
from codebotler.simulator.process.isolated_call import IDLE_PROCESSES
from codebotler.simulator.sandbox.isolation import NOBODY
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.robot import SimulatedRobot
from other_functions import with_functions
from processes import children_of, is_alive

WORLD = World((Room("start_loc"),), "start_loc")
ROOT = os.geteuid() == 0
USER = NOBODY if ROOT else os.geteuid()
CLOSED = ("compiler", "child of a batch", "child")
ROLES = (*CLOSED, "BatchServer", "ForkServer")
ZERO_LIMITS = {
    "Max core file size": "0",
    "Max file size": "0",
    "Max locked memory": "0",
    "Max msgqueue size": "0",
}
ENVIRONMENT = {"PYTHONHASHSEED", "TZ", "LC_ALL", "PYTHONUTF8", "LD_BIND_NOW"}


@dataclass(frozen=True)
class IsolationState:
    """The isolation of one process, read from the kernel.

    Args:
        limits: soft and hard limits by name.
        status: the lines of its status, by name.
        owner: the owner of its memory map; root if nobody else may read the memory.
        descriptors: the open file descriptors; None if only root may see them.
        environment: the names of its variables; None if only root may see them.
    """

    limits: dict[str, tuple[str, str]]
    status: dict[str, str]
    owner: int
    descriptors: set[int] | None
    environment: set[str] | None

    @classmethod
    def of(cls, pid: int) -> IsolationState:
        folder = Path(f"/proc/{pid}")
        limits = {
            line[:26].strip(): (line[26:47].strip(), line[47:68].strip())
            for line in (folder / "limits").read_text(encoding="ascii").splitlines()
        }
        lines = (folder / "status").read_text(encoding="ascii").splitlines()
        status = {name: value.strip() for name, _, value in (line.partition(":") for line in lines)}
        descriptors = {int(path.name) for path in (folder / "fd").iterdir()} if ROOT else None
        strings = (folder / "environ").read_bytes().decode().split("\0") if ROOT else None
        environment = {text.partition("=")[0] for text in strings if text} if strings else None
        return cls(limits, status, (folder / "maps").stat().st_uid, descriptors, environment)


@pytest.fixture(scope="module")
def states() -> Iterator[dict[str, IsolationState]]:
    """Yield the state of each process of a worker by role, read while a program speaks."""
    found: dict[str, IsolationState] = {}
    os.environ["A_SECRET"] = "hush"
    worker = Worker()

    def say(_robot: SimulatedRobot, message: str) -> None:
        found["compiler"] = IsolationState.of(
            IDLE_PROCESSES["codebotler.simulator.process.compiler"][-1]._process.pid
        )
        for kind, fork_server in worker._fork_servers.items():
            found[kind.__name__] = IsolationState.of(fork_server._process.pid)
            for pid in filter(is_alive, children_of(fork_server._process.pid)):
                found[message] = IsolationState.of(pid)

    def new_robot() -> SimulatedRobot:
        return SimulatedRobot(WORLD, skills=with_functions(SKILLS, say=say))

    program = "def task_program():\n    say('child')\n"
    worker.run(program.replace("child", "child of a batch"), new_robot)
    worker.run("class A: pass\n" + program, new_robot)
    yield found
    worker.close()
    del os.environ["A_SECRET"]


def limits_of(role: str) -> dict[str, tuple[str, str]]:
    """Return the permanent limits of a process, soft and hard."""
    memory = 384 if "batch" in role.lower() else 512
    limits = {**ZERO_LIMITS, "Max address space": str(memory * 1024**2)}
    return {name: (value, value) for name, value in limits.items()}


@pytest.mark.parametrize("role", ROLES)
def test_process_gives_up_its_rights(states: dict[str, IsolationState], role: str) -> None:
    process = states[role]
    assert process.status["Uid"].split() == [str(USER)] * 4
    if ROOT:
        assert process.status["Gid"].split() == [str(NOBODY)] * 4
        assert process.status["Groups"] == ""
    assert process.status["NoNewPrivs"] == "1"
    assert process.owner == 0, "other users can read its memory"
    wanted = limits_of(role)
    assert {name: process.limits[name] for name in wanted} == wanted


@pytest.mark.parametrize("role", CLOSED)
def test_process_that_runs_or_parses_programs_is_closed(states: dict[str, IsolationState], role: str) -> None:
    process = states[role]
    assert process.status["Seccomp"] == "2"
    seconds = ("2", "3") if role == "child of a batch" else ("5", "6")
    wanted = {
        **limits_of(role),
        "Max processes": ("0", "0"),
        "Max open files": ("4", "4"),
        "Max cpu time": seconds,
    }
    assert {name: process.limits[name] for name in wanted} == wanted


@pytest.mark.skipif(not ROOT, reason="only root may ask the kernel what another process has open")
@pytest.mark.parametrize("role", CLOSED)
def test_only_the_channel_is_open(states: dict[str, IsolationState], role: str) -> None:
    assert states[role].descriptors == {0, 1, 2, 3}


@pytest.mark.skipif(not ROOT, reason="only root may ask the kernel for another process's environment")
@pytest.mark.parametrize("role", ROLES)
def test_environment_of_the_engine_is_not_passed_on(states: dict[str, IsolationState], role: str) -> None:
    assert states[role].environment == ENVIRONMENT


# --- settings that only the process itself can read

REPORT = """
import ctypes, os, sys
from codebotler.simulator.sandbox import fork_server
from codebotler.simulator.sandbox import isolation
{deed}
signal = ctypes.c_int()
ctypes.CDLL(None).prctl(2, ctypes.byref(signal))  # PR_GET_PDEATHSIG
os._exit(100 + signal.value + 50 * ctypes.CDLL(None).prctl(3))  # PR_GET_DUMPABLE
"""
DEEDS = {
    "pass": 150,
    "os.geteuid = lambda: 1000; isolation.give_up_rights()": 109,  # a process that was root is never dumpable
    "fork_server.isolate(1, None, 5, os.getppid().to_bytes(8, 'big'))": 159,
    "fork_server.isolate(1, None, 5, (os.getppid() + 1).to_bytes(8, 'big'))": 1,  # its parent has ended
}


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux can be asked")
@pytest.mark.parametrize("deed", DEEDS)
def test_process_ends_with_its_parent_and_hides_its_memory(deed: str) -> None:
    process = subprocess.run([sys.executable, "-c", REPORT.format(deed=deed)], check=False, timeout=30)
    assert process.returncode == DEEDS[deed]
