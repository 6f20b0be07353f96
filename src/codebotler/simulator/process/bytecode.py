"""Compiles the code of fork servers: our modules and the standard library."""

from __future__ import annotations

import contextlib
import importlib
import inspect
import marshal
import os
import sys
from collections.abc import Callable
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType

from codebotler.simulator.sandbox import WITHOUT_REFERENCES
from codebotler.simulator.sandbox.stdlib import IMPORTED

SIMULATOR = __package__.rpartition(".")[0]
SANDBOX = Path(__file__).parents[1] / "sandbox"


def compiled_modules(compiler: Callable[[str, str], bytes]) -> bytes:
    """Return the code of all modules of a fork server, by name, as one marshalled message."""
    package = f"{SIMULATOR}.sandbox"
    files = {package: str(SANDBOX / "__init__.py")}
    files |= {f"{package}.{path.stem}": str(path) for path in sorted(SANDBOX.glob("[a-z]*.py"))}
    files |= {name: inspect.getfile(importlib.import_module(name)) for name in ("__future__", "types")}
    codes = {name: compiled_source("", f"<{name}>") for name in (SIMULATOR.partition(".")[0], SIMULATOR)}
    codes |= {name: compiler(file, f"<{name}>") for name, file in files.items()}
    codes |= {name: code_of(str(file), file.name) for name, file in stdlib_files().items()}
    return marshal.dumps(codes, WITHOUT_REFERENCES)


def stdlib_files() -> dict[str, Path]:
    """Find the files of the standard library modules that programs can import, and of their submodules."""
    folder, files = Path(os.__file__).parent, {}
    for name in IMPORTED:
        path = folder.joinpath(*name.split("."))
        if path.with_suffix(".py").is_file():
            files[name] = path.with_suffix(".py")
        elif (path / "__init__.py").is_file():
            files[name] = path / "__init__.py"
            parts = (part for part in sorted(path.glob("*.py")) if part.stem != "__init__")
            files |= {f"{name}.{part.stem}": part for part in parts}
    return files


def code_of(file: str, shown: str) -> bytes:
    """Return a module's code, whatever the interpreter's options. Tracebacks show the file name `shown`."""
    code = None
    if not sys.flags.optimize:
        with contextlib.suppress(EOFError, ImportError, ValueError):  # the bytecode file is damaged
            code = SourceFileLoader(shown, file).get_code(shown)
    if code is None or all(column is None for _, _, column, _ in code.co_positions()):
        # Compile again, since an interpreter that omits column numbers wrote this shorter code.
        return compiled_source(Path(file).read_text(encoding="utf-8"), shown)
    return dumped(code, shown)


def compiled_source(source: str, shown: str) -> bytes:
    """Compile a source text."""
    return dumped(compile(source, "", "exec", dont_inherit=True, optimize=0), shown)


def dumped(code: CodeType, shown: str) -> bytes:
    """Serialize code without paths, since their length would change memory addresses."""

    def nameless(code: CodeType) -> CodeType:
        parts = (nameless(part) if isinstance(part, CodeType) else part for part in code.co_consts)
        return code.replace(co_filename=shown, co_consts=tuple(parts))

    return marshal.dumps(nameless(code), WITHOUT_REFERENCES)
