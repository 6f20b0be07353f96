"""Run each file of custom skills once, as a module that any process can find again."""

from __future__ import annotations

import hashlib
import sys
from importlib import import_module
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType

from codebotler.core.errors import UserError

OWN_MODULES = "codebotler_skills_"
"""The prefix of the module names of custom skill files."""


def is_own_module(name: str) -> bool:
    """Whether a module with this name is a file of custom skills."""
    return name.startswith(OWN_MODULES)


def load_own_module(path: Path) -> ModuleType:
    """Run a file of custom skills once, and return its module. A later call returns the same module.

    Raises:
        UserError: the file cannot be read.
        BaseException: any error that the file raises.
    """
    try:
        source = path.read_bytes()
    except OSError as error:
        raise UserError(f"the file cannot be read ({error.strerror})", file=path) from None
    where = str(path.resolve())
    name = OWN_MODULES + hashlib.sha256(where.encode() + b"\0" + source).hexdigest()[:16]
    if name in sys.modules:
        return sys.modules[name]
    spec = spec_from_loader(name, None, origin=where)
    assert spec is not None, "it has a name"
    module = module_from_spec(spec)
    module.__file__ = where
    sys.modules[name] = module
    folder = str(path.resolve().parent)
    if folder not in sys.path:  # so that the file can import its neighbours, like a script
        sys.path.append(folder)
    try:
        exec(compile(source, str(path), "exec", dont_inherit=True), vars(module))  # noqa: S102 - the user's own code
    except BaseException:
        del sys.modules[name]
        raise
    return module


def location_of(module: str) -> str:
    """Return where `find_object` finds a module: the path of a custom skill file, or else a module's name."""
    return str(sys.modules[module].__file__) if is_own_module(module) else module


def find_object(place: str, name: str) -> object:
    """Import a module from `place`, as `location_of` returns it, and return its object `name`."""
    module = load_own_module(Path(place)) if place.endswith(".py") else import_module(place)
    return getattr(module, name)
