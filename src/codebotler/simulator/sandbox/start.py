"""Starts every isolated process: fixes memory layout and limits, then lets it serve in its role."""

from __future__ import annotations

import os
import sys
from _frozen_importlib import ModuleSpec
from marshal import loads

TYPE_CHECKING = False
if TYPE_CHECKING:
    import types
    from typing import NoReturn

FIRST_DESCRIPTOR = 4  # of the descriptors that the engine hands over
CODES_DESCRIPTOR = FIRST_DESCRIPTOR  # a file with the code of our own modules
STACK = 8 * 1024 * 1024
ADDR_NO_RANDOMIZE = 0x0040000


def main(module: str, role: str, descriptors: list[str]) -> None:
    """Start the interpreter again if there are descriptors, then take on a role, which a module knows."""
    if descriptors:
        start_again(list(map(int, descriptors)))
    if role not in ("preparer", "batch-fork-server"):  # bytecode, now there and now not, would move the heap
        sys.pycache_prefix = os.devnull  # of what is not handed over
    modules = CompiledModules(loads(os.pread(CODES_DESCRIPTOR, os.fstat(CODES_DESCRIPTOR).st_size, 0)))  # noqa: S302 - from the engine
    sys.meta_path.insert(0, modules)
    os.close(CODES_DESCRIPTOR)
    taken_on = __import__(module, fromlist=["serve"])
    ready = taken_on.get_ready(role)
    modules.codes.clear()  # nothing is imported any more
    taken_on.serve(*ready)


class CompiledModules:
    """Importer of modules that the engine has compiled, since a compiler would double a fork server.

    Those of the standard library look as if they came from a file.
    """

    def __init__(self, codes: dict[str, bytes]) -> None:
        self.codes = codes  # marshalled, by the name of the module

    def find_spec(self, name: str, *_: object) -> ModuleSpec | None:
        """Describe a module to the import system."""
        if name not in self.codes:
            return None
        is_package = any(other.startswith(name + ".") for other in self.codes)
        spec = ModuleSpec(name, self, is_package=is_package)  # type: ignore[arg-type]  # it has what is needed
        if is_package and name.partition(".")[0] != "codebotler":  # some of it may not have been handed over
            folder = os.__file__.rpartition("/")[0]
            spec.submodule_search_locations = [f"{folder}/{name.replace('.', '/')}"]
        return spec

    def create_module(self, _: ModuleSpec) -> None:
        """Make an ordinary module."""

    def exec_module(self, module: types.ModuleType) -> None:
        """Run its code, for which there is no use afterwards."""
        name, spec = module.__name__, module.__spec__
        if spec is not None and name.partition(".")[0] != "codebotler":
            module.__file__ = spec.origin = f"{name}.py"
            spec.has_location = True
        exec(loads(self.codes.pop(name)), vars(module))  # noqa: S102, S302 - from the engine


def start_again(descriptors: list[int]) -> NoReturn:
    """Start the interpreter again, with descriptors from FIRST_DESCRIPTOR on and with fixed addresses.

    A program may say an address. It must be the same in every start, and even the lengths of arguments and
    the numbers of descriptors would move it.
    """
    import ctypes  # noqa: PLC0415 - it is large, and the second start has no use for it
    from fcntl import F_DUPFD, fcntl  # noqa: PLC0415 - the same

    forget_the_shell()
    end = FIRST_DESCRIPTOR + len(descriptors)
    copies = [fcntl(descriptor, F_DUPFD, end) for descriptor in descriptors]
    for number, copy in enumerate(copies, FIRST_DESCRIPTOR):
        os.dup2(copy, number, inheritable=True)
    os.closerange(end, 65536)
    if sys.platform == "linux":
        ctypes.CDLL(None).personality(ctypes.c_ulong(ADDR_NO_RANDOMIZE))
    os.execv(sys.executable, sys.orig_argv[: -len(descriptors)])  # noqa: S606 - the same program again


def forget_the_shell() -> None:
    """Undo what a process inherits from a shell: ignored signals, the size of the stack."""
    import _signal  # type: ignore[import-not-found] # noqa: PLC0415 - the second start has no use for it
    from resource import RLIMIT_STACK, getrlimit, setrlimit  # noqa: PLC0415 - the same

    for number in _signal.valid_signals() - {_signal.SIGKILL, _signal.SIGSTOP}:
        _signal.signal(number, _signal.SIG_DFL)
    _signal.pthread_sigmask(_signal.SIG_SETMASK, ())
    _, hard = getrlimit(RLIMIT_STACK)
    try:
        setrlimit(RLIMIT_STACK, (STACK if hard < 0 else min(STACK, hard), hard))
    except (ValueError, OSError):
        if sys.platform == "linux":
            raise


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3:])
