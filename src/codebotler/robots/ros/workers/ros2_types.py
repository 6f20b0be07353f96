"""ROS 2 action types, generated and compiled once if their packages are not installed."""

from __future__ import annotations

import hashlib
import importlib
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Dict, Sequence

from channel import Message, SetupError
from message_types import parts_of

NEEDED = ("action_msgs", "builtin_interfaces", "service_msgs", "unique_identifier_msgs")
"""The packages whose messages are part of each action."""

GENERATORS = (
    "generator_type_description",
    "generator_c",
    "typesupport_fastrtps_c",
    "typesupport_introspection_c",
    "typesupport_c",
    "generator_py",
)
SUPPORTS = ("rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")
PRELOADS = """\
import ctypes
import pathlib

for support in {supports}:  # found by their names, once they are loaded
    ctypes.CDLL(str(pathlib.Path(__file__).parent / f"lib{package}__{{support}}.so"))
"""
LIBRARIES = (
    "generator_c",
    "generator_py",
    "typesupport_c",
    "typesupport_fastrtps_c",
    "typesupport_introspection_c",
)
RUNTIME = (*SUPPORTS, "rosidl_runtime_c", "rosidl_typesupport_c", "rcutils", "fastcdr")
COMPILERS = {".c": "cc", ".cpp": "c++"}
Definitions = Dict[str, str]


def action_types(actions: list[Message], tell: Callable[[str], object] = lambda _: None) -> dict[str, Any]:
    """Action types by their `type`, from rows with this and the `definition` of an .action file.

    Args:
        actions: what a robot offers.
        tell: called with a sentence before something that takes long.

    Raises:
        SetupError: an installed package differs, or one that is missing cannot be built.
    """
    packages: dict[str, Definitions] = {}
    for action in actions:
        package, name = parts_of(action["type"])
        packages.setdefault(package, {})[name] = action["definition"]
    modules = {package: _module(package, texts, tell) for package, texts in packages.items()}
    found = {}
    for action in actions:
        package, name = parts_of(action["type"])
        found[action["type"]] = _checked(modules[package], name, action["definition"])
    return found


def fields_of(definition: str) -> list[list[str]]:
    """The names of the fields of goal, result and feedback."""
    parts = (definition + "\n").split("---\n")
    return [[line.split()[1] for line in part.splitlines() if line.strip()] for part in parts]


def plain(value: Any) -> Any:
    """The value of a field as JSON has it; an array of numbers is none of Python's lists."""
    return list(value) if hasattr(value, "typecode") else value


def as_in(default: Any, value: Any) -> Any:
    """A value of JSON as a field with this default takes it: a whole number may be meant as a float."""
    if isinstance(default, float):
        return float(value)
    if getattr(default, "typecode", "") in {"d", "f"}:
        return [float(each) for each in value]
    return value


def _module(package: str, definitions: Definitions, tell: Callable[[str], object]) -> Any:
    try:
        return importlib.import_module(package + ".action")
    except ModuleNotFoundError as error:
        if error.name not in {package, package + ".action"}:
            raise
    sys.path.insert(0, str(built(package, definitions, tell)))
    importlib.invalidate_caches()
    return importlib.import_module(package + ".action")


def _checked(module: Any, name: str, definition: str) -> Any:
    spec = getattr(module, name, None)
    where = Path(module.__file__).parent
    package = module.__name__.partition(".")[0]
    if spec is None:
        raise SetupError(f"{package} in {where} has no action {name}; add {name}.action and build it again")
    for part, fields in zip((spec.Goal, spec.Result), fields_of(definition)):
        installed = list(part.get_fields_and_field_types())
        if installed != fields:
            raise SetupError(
                f"{package}/action/{name} in {where} has the fields {', '.join(installed) or 'none'}, "
                f"but {', '.join(fields) or 'none'} are needed; build it again"
            )
    return spec


def built(package: str, definitions: Definitions, tell: Callable[[str], object] = lambda _: None) -> Path:
    """A folder for sys.path with a package that has these actions, built unless that was done before.

    Raises:
        SetupError: there is no C++ compiler, or it fails.
    """
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)  # ROS from wheels lies in the environment itself
    from ament_index_python import get_package_share_directory as share

    shares = {name: Path(share(name)) for name in (*NEEDED, *("rosidl_" + name for name in GENERATORS))}
    versions = [(folder / "package.xml").read_text() for folder in shares.values()]
    parts = [package, definitions, sysconfig.get_config_var("SOABI"), versions, Path(__file__).read_text()]
    key = hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "codebotler" / "ros2"
    folder = home / f"{package}-{key}"
    if folder.exists():
        return folder
    missing = [name for name in COMPILERS.values() if shutil.which(name) is None]
    if missing:
        raise SetupError(
            f"{package} must be compiled once, but there is no {missing[0]}; "
            f"install g++, or build {package} with colcon and source it"
        )
    tell(f"building the ROS 2 messages of {package}, once: this takes half a minute")
    home.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=str(home)) as temporary:
        _Build(package, Path(temporary), shares).make(definitions)
        try:
            (Path(temporary) / "made").rename(folder)
        except OSError:  # another worker was faster
            if not folder.exists():
                raise
    return folder


class _Build:
    """Builds one package, as the CMake functions of ROS do, but only what rclpy needs."""

    def __init__(self, package: str, work: Path, shares: dict[str, Path]) -> None:
        self.package, self.work, self.shares = package, work, shares
        self.made = work / "made" / package
        self.prefix = shares["action_msgs"].parents[1]

    def make(self, definitions: Definitions) -> None:
        (self.made / "action").mkdir(parents=True)
        (self.made / "__init__.py").write_text(PRELOADS.format(package=self.package, supports=SUPPORTS))
        self._generate(definitions)
        module = f"{self.package}_s__rosidl_typesupport_c{sysconfig.get_config_var('EXT_SUFFIX')}"
        objects = [self._compiled(unit) for unit in list(self._units())]
        libraries = [f"-l{name}__rosidl_{kind}" for name in NEEDED for kind in LIBRARIES]
        self._run(
            "c++", "-shared", "-s", "-Wl,--allow-shlib-undefined", f"-Wl,-soname,{module}", "-o",
            str(self.made / module), *objects,
            "-L", str(self.prefix / "lib"), *libraries, *(f"-l{name}" for name in RUNTIME)
        )  # fmt: skip
        libraries = [f"lib{self.package}__{support}.so" for support in SUPPORTS]
        for library in libraries:  # empty, but leads to all symbols of the module
            self._run(
                "c++", "-shared", f"-Wl,-soname,{library}", "-Wl,--no-as-needed", "-Wl,-rpath,$ORIGIN",
                "-Wl,--allow-shlib-undefined", str(self.made / module), "-o", str(self.made / library)
            )  # fmt: skip
        kept = {module, *libraries}
        for path in sorted(self.made.rglob("*"), reverse=True):
            if path.is_dir() and not any(path.iterdir()):
                path.rmdir()
            elif path.is_file() and path.suffix != ".py" and path.name not in kept:
                path.unlink()

    def _generate(self, definitions: Definitions) -> None:
        from rosidl_adapter.action import convert_action_to_idl
        from rosidl_generator_c import generate_c
        from rosidl_generator_py import generate_py
        from rosidl_generator_type_description import generate_type_hash
        from rosidl_typesupport_c import generate_c as generate_typesupport_c
        from rosidl_typesupport_fastrtps_c import generate_typesupport_fastrtps_c
        from rosidl_typesupport_introspection_c import generate_c as generate_introspection_c

        self.idls = []
        for name, text in sorted(definitions.items()):
            source = Path("action") / f"{name}.action"
            (self.work / "action").mkdir(exist_ok=True)
            (self.work / source).write_text(text)
            self.idls.append(
                convert_action_to_idl(self.work, self.package, source, self.made / "action").name
            )
        generate_type_hash(
            self._arguments(
                "generator_type_description", include_paths=[f"{n}:{self.shares[n]}" for n in NEEDED]
            )
        )
        hashes = [f"action/{name}:{self.made / 'action' / name[:-4]}.json" for name in self.idls]
        sources = [str(self.work / "action" / f"{name}.action") for name in sorted(definitions)]
        generate_c(
            self._arguments("generator_c", type_description_tuples=hashes, ros_interface_files=sources)
        )
        generate_typesupport_fastrtps_c(self._arguments("typesupport_fastrtps_c"))
        generate_typesupport_c(self._arguments("typesupport_c"), list(SUPPORTS))
        generate_introspection_c(
            self._arguments(
                "typesupport_introspection_c", output_dir=str(self.work / "introspection" / self.package)
            )
        )
        generate_py(self._arguments("generator_py"), ["rosidl_typesupport_c"])
        for generator in ("generator_c", "typesupport_fastrtps_c", "typesupport_introspection_c"):
            self._write_visibility(f"rosidl_{generator}__visibility_control.h", self._templates(generator))

    def _templates(self, generator: str) -> Path:
        return self.shares["rosidl_" + generator] / "resource"

    def _arguments(self, generator: str, **more: Any) -> str:
        """A file of arguments, as the generators read them."""
        interfaces = [f"{name}:{path}" for name in NEEDED for path in self.shares[name].glob("*/*.idl")]
        arguments = {
            "package_name": self.package,
            "output_dir": str(self.made),
            "template_dir": str(self._templates(generator)),
            "idl_tuples": [f"{self.made}:action/{name}" for name in self.idls],
            "ros_interface_dependencies": interfaces,
            "target_dependencies": [],
            **more,
        }
        path = self.work / f"{generator}.json"
        path.write_text(json.dumps(arguments))
        return str(path)

    def _write_visibility(self, header: str, templates: Path) -> None:
        text = (templates / f"{header}.in").read_text()
        text = text.replace("@PROJECT_NAME@", self.package)
        text = text.replace("@PROJECT_NAME_UPPER@", self.package.upper())
        (self.made / "msg").mkdir(exist_ok=True)
        (self.made / "msg" / header).write_text(text)

    def _units(self) -> Iterator[Path]:
        """What is compiled: one file for all of a language, but for descriptions, whose names collide."""
        introspection = self.work / "introspection.c"
        files = sorted((self.work / "introspection").rglob("*.c"))
        introspection.write_text("".join(f'#include "{path}"\n' for path in files))
        yield introspection
        for suffix in COMPILERS:
            files = sorted(self.made.rglob("*" + suffix))
            together = [path for path in files if not path.stem.endswith("__description")]
            unit = self.work / ("all" + suffix)
            unit.write_text("".join(f'#include "{path}"\n' for path in together))
            yield unit
            yield from (path for path in files if path not in together)

    def _compiled(self, unit: Path) -> str:
        from numpy import get_include

        headers = self.prefix / "include"
        folders = [
            self.work / "made",
            self.work / "introspection",
            headers,
            Path(sysconfig.get_paths()["include"]),
            Path(get_include()),
        ]
        folders += [path for path in headers.iterdir() if (path / path.name).is_dir()]
        done = self.work / (unit.name + ".o")
        includes = [argument for path in folders for argument in ("-I", str(path))]
        self._run(COMPILERS[unit.suffix], "-c", "-fPIC", "-O0", "-w", *includes, str(unit), "-o", str(done))
        return str(done)

    def _run(self, *command: str) -> None:
        done = subprocess.run(  # noqa: S603 - the compiler, on what was generated
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
        )
        if done.returncode:
            sys.stderr.write(done.stdout)
            lines: Sequence[str] = done.stdout.splitlines() or [""]
            error = next((line for line in lines if "error" in line), lines[-1])
            raise SetupError(
                f"{self.package} could not be compiled ({error.strip()}); is python3-dev installed?"
            )
