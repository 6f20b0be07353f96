"""Isolation holds for root and for ordinary users, and missing isolation is reported."""

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from command_line import Ended, forked

NOBODY = 65534
ROOT = os.geteuid() == 0
BECOME = ["setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups"]

# --- as root, and as an ordinary user

CHECK = """
import json, os, sys
from codebotler.simulator.engine import run
from codebotler.simulator.settings import SimulationSettings
from codebotler.core.trace import outcome_data
from codebotler.core.world import Room, World

world = World((Room("start"),), "start")
programs = [
    "import os, signal\\ndef task_program():\\n    " + body.replace("PARENT", str(os.getpid()))
    for body in json.loads(sys.argv[1])
]
outcomes = run([(p, world) for p in programs], workers=1, settings=SimulationSettings(literals="as-written"),
               require_isolation=True)
print(os.geteuid(), json.dumps([outcome_data(outcome) for outcome in outcomes]))
"""
ATTACKS = {
    "open('SECRET').read()": "PermissionError",
    "open('FOLDER/new', 'w')": "PermissionError",
    "os.listdir('FOLDER')": "PermissionError",
    "import socket; socket.socket()": "PermissionError",
    "os.fork()": "PermissionError",
    "os.execv('/bin/true', ['true'])": "PermissionError",
    "import subprocess; subprocess.run(['true'])": "PermissionError",
    "import threading; threading.Thread(target=print).start()": "RuntimeError",
    "os.kill(PARENT, signal.SIGKILL)": "PermissionError",
    "os.kill(os.getppid(), signal.SIGKILL)": "PermissionError",
    "os.write(1, b'x')": "PermissionError",
    "bytearray(10**10)": "MemoryError",
    "os.abort()": "Crash",
    "while True: pass": "TimeoutError",
}
"""Code of hostile programs, with the kind of error that stops each."""


@pytest.fixture(scope="module")
def folder() -> Iterator[Path]:
    """Yield a folder that everybody may enter and write to, with a file that everybody may read."""
    path = Path(tempfile.mkdtemp(prefix="iso-", dir="/tmp"))  # it replaces a path of a fixed length
    path.chmod(0o777)
    (path / "secret").write_text("hush", encoding="ascii")
    (path / "secret").chmod(0o644)
    yield path
    shutil.rmtree(path)


@pytest.fixture(scope="module")
def open_to_all(folder: Path) -> list[str]:
    """Return a command that starts Python with this project for every user, from a copy if needed."""
    here = [sys.executable, "-B"]
    if not ROOT or run_as(NOBODY, [*here, "-c", CHECK, "[]"]).returncode == 0:
        return here
    python = copy_python(folder / "py")
    library = folder / "library"
    library.mkdir()
    for path in find_needed_modules():
        if path.is_dir():
            shutil.copytree(path, library / path.name)
        else:
            shutil.copy2(path, library)
    return ["env", f"PYTHONPATH={library}", str(python), "-B"]


def copy_python(to: Path) -> Path:
    """Copy the interpreter and its library to a folder that other users can read."""
    library = Path(sysconfig.get_path("stdlib"))
    unneeded = shutil.ignore_patterns("site-packages", "test", "idlelib", "tkinter", "ensurepip", "config-*")
    shutil.copytree(library, to / "lib" / library.name, ignore=unneeded)
    program = Path(sys.executable).resolve().read_bytes()
    if sysconfig.get_config_var("Py_ENABLE_SHARED"):  # the program holds the path of its library's folder
        there = Path(sysconfig.get_config_var("LIBDIR"))
        shutil.copy2(there / sysconfig.get_config_var("INSTSONAME"), to / "lib")
        old = bytes(there)
        program = program.replace(old + b"\0", bytes(to / "lib").ljust(len(old), b"\0") + b"\0")
    copy = to / "bin" / library.name
    copy.parent.mkdir()
    copy.write_bytes(program)
    copy.chmod(0o755)
    return copy


def find_needed_modules() -> list[Path]:
    """Return the packages and modules outside the standard library that the engine needs."""
    listing = (
        "import sys, codebotler.core.trace, codebotler.simulator.engine\n"
        "for name, module in list(sys.modules.items()):\n"
        "    if '.' not in name and getattr(module, '__file__', None): print(module.__file__)"
    )
    output = subprocess.check_output([sys.executable, "-c", listing], text=True)
    standard = Path(sysconfig.get_path("stdlib"))
    files = [Path(line) for line in output.splitlines()]
    return [
        file.parent if file.name == "__init__.py" else file
        for file in files
        if "site-packages" in file.parts or standard not in file.parents
    ]


def run_as(user: int, command: list[str]) -> subprocess.CompletedProcess[str]:
    command = command if user == os.geteuid() else [*BECOME, *command]
    return subprocess.run(command, check=False, capture_output=True, text=True, timeout=60)


@pytest.mark.slow
@pytest.mark.parametrize("user", [0, NOBODY] if ROOT else [os.geteuid()])
def test_programs_cannot_break_out_for_any_user_of_the_engine(
    folder: Path, open_to_all: list[str], user: int
) -> None:
    attacks = [
        body.replace("SECRET", str(folder / "secret")).replace("FOLDER", str(folder)) for body in ATTACKS
    ]
    process = run_as(user, [*open_to_all, "-c", CHECK, json.dumps([*attacks, "say('a')"])])
    assert (process.returncode, process.stderr) == (0, "")
    ran_as, _, printed = process.stdout.partition(" ")
    assert int(ran_as) == user
    *outcomes, honest = json.loads(printed)
    assert [outcome["error"]["kind"] for outcome in outcomes] == list(ATTACKS.values())
    assert [outcome["trace"] for outcome in outcomes] == [[]] * len(ATTACKS)
    assert (honest["status"], honest["trace"]) == ("finished", [["say", "a"]])
    assert not (folder / "new").exists()


# --- without the list of system calls

BELOW_A_FILTER = """
import ctypes, platform, struct, sys
from codebotler.simulator.sandbox.isolation import ALLOW, DENY, EQUAL, FIRST_ARGUMENT, LOAD, RETURN
from codebotler.simulator.sandbox.isolation import SYSCALL_NUMBER
from codebotler.simulator.sandbox.isolation import PR_SET_SECCOMP, install, refuse_new_rights

prctl, seccomp = {"x86_64": (157, 317), "aarch64": (167, 277)}[platform.machine()]
code = [
    (LOAD, 0, 0, SYSCALL_NUMBER),
    (EQUAL, 4, 0, seccomp),
    (EQUAL, 0, 2, prctl),
    (LOAD, 0, 0, FIRST_ARGUMENT),
    (EQUAL, 1, 0, PR_SET_SECCOMP),
    (RETURN, 0, 0, ALLOW),
    (RETURN, 0, 0, DENY),
]
instructions = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *line) for line in code))
header = struct.pack("HxxxxxxP", len(code), ctypes.addressof(instructions))
refuse_new_rights()
install((header, bytes(instructions)))
"""
EVALUATE = """
from roboeval.cli.app import main
sys.argv[0] = "roboeval"
main()
"""
MISSING = r"(roboeval: )?[^\n]*less isolated[^\n]*kernel does not allow[^\n]*\(seccomp\)\n"


def run_evaluate(*options: str, before: str = "import sys") -> Ended:
    """Run `roboeval evaluate` in a process that executes some code first."""
    arguments = ["evaluate", "recorded:careful", "--tasks", "SayGoodDay", "--json", *options]
    return forked("-c", before + EVALUATE, *arguments)


@pytest.mark.slow
def test_missing_seccomp_is_one_warning_and_changes_no_verdict() -> None:
    below, bare = run_evaluate(before=BELOW_A_FILTER), run_evaluate()
    assert below.status == 0
    assert re.fullmatch(MISSING, below.err)
    assert (bare.status, bare.err) == (0, "")
    assert below.out == bare.out != ""


@pytest.mark.slow
def test_required_isolation_fails_without_seccomp() -> None:
    refused = run_evaluate("--require-isolation", before=BELOW_A_FILTER)
    assert (refused.status, refused.out) == (1, "")
    assert re.fullmatch(MISSING, refused.err)
    assert run_evaluate("--require-isolation").status == 0


@pytest.mark.slow
def test_other_layers_of_isolation_hold_without_seccomp(folder: Path) -> None:
    attacks = {f"open('{folder}/secret')": "OSError", "os.fork()": "BlockingIOError", "say('a')": None}
    check = BELOW_A_FILTER + CHECK.replace("require_isolation=True", "require_isolation=False")
    process = run_as(os.geteuid(), [sys.executable, "-c", check, json.dumps(list(attacks))])
    assert process.returncode == 0
    assert re.fullmatch(MISSING, process.stderr)
    outcomes = json.loads(process.stdout.partition(" ")[2])
    assert [(outcome["error"] or {}).get("kind") for outcome in outcomes] == list(attacks.values())
