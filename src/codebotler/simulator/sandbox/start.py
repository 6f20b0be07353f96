"""Starts each fork server for wild programs: fixes its memory layout and limits, then serves."""

from __future__ import annotations

import os
import sys
from _frozen_importlib import ModuleSpec
from marshal import loads

TYPE_CHECKING = False
if TYPE_CHECKING:
    import types
    from typing import NoReturn

FIRST_DESCRIPTOR = 4  # of the descriptors that the engine passes
CODES = 6  # the last one, a file with the code of our modules
STACK = 8 * 1024 * 1024
ADDR_NO_RANDOMIZE = 0x0040000


def main(descriptors: list[str]) -> None:
    """Restart Python with these descriptors or, after the restart (no descriptors), run the fork server."""
    if descriptors:
        start_again(list(map(int, descriptors)))
    sys.pycache_prefix = os.devnull  # a bytecode file that may or may not exist would move the heap
    modules = _CompiledModules(loads(os.pread(CODES, os.fstat(CODES).st_size, 0)))  # noqa: S302 - from the engine
    sys.meta_path.insert(0, modules)
    os.close(CODES)
    from codebotler.simulator.sandbox.fork_server import get_ready, serve  # noqa: PLC0415 - found by `modules`

    ready = get_ready()
    modules.codes.clear()  # there are no more imports
    serve(*ready)


class _CompiledModules:
    """Imports modules that the engine has compiled, since a compiler would double a fork server's size.

    Modules of the standard library look as if they were loaded from a file.
    """

    def __init__(self, codes: dict[str, bytes]) -> None:
        self.codes = codes  # marshalled code by module name

    def find_spec(self, name: str, *_: object) -> ModuleSpec | None:
        if name not in self.codes:
            return None
        is_package = any(other.startswith(name + ".") for other in self.codes)
        spec = ModuleSpec(name, self, is_package=is_package)  # type: ignore[arg-type]  # it has the methods of a loader
        if is_package and name.partition(".")[0] != "codebotler":  # some submodules may be missing
            folder = os.__file__.rpartition("/")[0]
            spec.submodule_search_locations = [f"{folder}/{name.replace('.', '/')}"]
        return spec

    def create_module(self, _: ModuleSpec) -> None:
        """Leave the creation of the module to Python."""

    def exec_module(self, module: types.ModuleType) -> None:
        """Run a module's compiled code, and forget the code to save memory."""
        name, spec = module.__name__, module.__spec__
        if spec is not None and name.partition(".")[0] != "codebotler":
            module.__file__ = spec.origin = f"{name}.py"
            spec.has_location = True
        exec(loads(self.codes.pop(name)), vars(module))  # noqa: S102, S302 - from the engine


def start_again(descriptors: list[int]) -> NoReturn:
    """Restart the interpreter with fixed addresses, and with the descriptors from FIRST_DESCRIPTOR on.

    A program may print an address, which must be the same after every start. Even the length of an argument
    or the number of a descriptor would change it.
    """
    import ctypes  # noqa: PLC0415 - large, and not needed after the restart

    reset_inherited_settings()
    arrange(descriptors)
    if sys.platform == "linux":
        ctypes.CDLL(None).personality(ctypes.c_ulong(ADDR_NO_RANDOMIZE))
    os.execv(sys.executable, sys.orig_argv[: -len(descriptors)])  # noqa: S606 - runs this program again


def arrange(descriptors: list[int]) -> None:
    """Give descriptors the numbers FIRST_DESCRIPTOR, FIRST_DESCRIPTOR + 1 and so on. Close higher ones."""
    from fcntl import F_DUPFD, fcntl  # noqa: PLC0415 - not needed after the restart

    end = FIRST_DESCRIPTOR + len(descriptors)
    copies = [fcntl(descriptor, F_DUPFD, end) for descriptor in descriptors]
    for number, copy in enumerate(copies, FIRST_DESCRIPTOR):
        os.dup2(copy, number, inheritable=True)
    os.closerange(end, 65536)


def reset_inherited_settings() -> None:
    """Reset the settings inherited from the shell: signal handling and the stack size."""
    import _signal  # type: ignore[import-not-found] # noqa: PLC0415 - not needed after the restart
    from resource import RLIMIT_STACK, getrlimit, setrlimit  # noqa: PLC0415 - see above

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
    main(sys.argv[1:])
