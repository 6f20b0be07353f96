"""Import ROS 2 types, building them once if they are not installed, and fill messages from plain data."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Callable, Dict, Sequence

from channel import Fields, SetupError

ACTION_PACKAGES = ("action_msgs", "builtin_interfaces", "service_msgs", "unique_identifier_msgs")
"""The packages with the message types that every action uses."""

GENERATORS = (
    "generator_type_description",
    "generator_c",
    "typesupport_fastrtps_c",
    "typesupport_introspection_c",
    "typesupport_c",
    "generator_py",
)
TYPE_SUPPORTS = ("rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")
PRELOAD_CODE = """\
import ctypes
import pathlib

for support in {supports}:  # ROS finds loaded libraries by name
    ctypes.CDLL(str(pathlib.Path(__file__).parent / f"lib{package}__{{support}}.so"))
"""
COMPILERS = {".c": "cc", ".cpp": "c++"}
USED_TYPE = re.compile(r"^\s*(?:(\w+)/)?([A-Z]\w*)", re.MULTILINE)
ProgressListener = Callable[[str], object]
Definitions = Dict[str, str]  # the texts of definitions by kind and name, such as action/GoTo


def message_types(
    names: Sequence[str],
    folders: Iterable[Path],
    tell: ProgressListener = lambda _: None,
    *,
    actions: Definitions | None = None,
) -> dict[str, Any]:
    """Return the Python classes of messages, services and actions by names such as std_msgs/msg/String.

    Args:
        names: all types that the process needs, since a package is built with these types only.
        folders: the folders of packages to build if they are not installed, with action/, msg/ or srv/.
        tell: a callback that receives a sentence before a slow step.
        actions: the texts of .action files by type name. An installed type must have the same fields.

    Raises:
        SetupError: a package or definition is missing or cannot be built, or an action's fields differ.
    """
    sources, texts = {folder.name: folder for folder in folders}, actions or {}
    wanted: dict[str, Definitions] = {}
    for name in names:
        package, _, kind = name.partition("/")
        wanted.setdefault(package, {})[kind] = texts.get(name, "")
    for package, definitions in wanted.items():
        if _is_installed(package):
            continue
        if not all(definitions.values()):
            if package not in sources:
                lacks = "is not installed; source its workspace, or list its folder in packages"
                raise SetupError(f"the ROS 2 package {package} {lacks}")
            definitions.update(_definitions(sources[package], [*definitions]))
        sys.path.insert(0, str(build_package(package, definitions, tell)))
        importlib.invalidate_caches()
    return {
        name: _check_action(name, texts[name]) if name in texts else _import_class(name) for name in names
    }


def fields_of(definition: str) -> list[list[str]]:
    """Return the field names of the goal, the result and the feedback in the text of an .action file."""
    parts = (definition + "\n").split("---\n")
    return [[line.split()[1] for line in part.splitlines() if line.strip()] for part in parts]


def fill(message: Any, values: Fields, where: str = "") -> Any:
    """Set fields of a message from nested dictionaries, and return the message.

    Args:
        message: the message to modify.
        values: the values by field name. A float field accepts an integer.
        where: the path of the message, such as `pose.`, which error messages put before a field's name.

    Raises:
        SetupError: a field does not exist, or a value does not fit.
    """
    kinds = message.get_fields_and_field_types()
    if hasattr(message, "_check_fields"):
        message._check_fields = True  # without these checks, a wrong value can crash rclpy
    for name, value in values.items():
        path = where + name
        if name not in kinds:
            known = ", ".join(where + kind for kind in kinds)
            raise SetupError(f"unknown field {path}; the fields are: {known}")
        try:
            setattr(message, name, _fit(getattr(message, name), kinds[name], value, path))
        except (AssertionError, TypeError, ValueError, OverflowError):
            raise SetupError(f"the field {path} must be {kinds[name]}, not {json.dumps(value)}") from None
    return message


def _fit(default: Any, kind: str, value: Any, path: str) -> Any:
    base = re.sub(r"sequence<|[,>\[].*", "", kind)
    if isinstance(value, list):
        return [_fit(None, base, each, f"{path}[{index}]") for index, each in enumerate(value)]
    if "/" in base and base == kind and isinstance(value, dict):
        return fill(default or _import_class(base.replace("/", "/msg/"))(), value, path + ".")
    return float(value) if base in {"float", "double"} and type(value) is int else value


def _is_installed(package: str) -> bool:
    spec = importlib.util.find_spec(package)
    return spec is not None and spec.origin is not None  # a plain folder of definitions has no origin


def _definitions(folder: Path, wanted: list[str]) -> Definitions:
    """Return the texts of a package's wanted definitions, and of the package's messages that they use."""
    found: Definitions = {}
    while wanted:
        name, *wanted = wanted
        path = folder / f"{name}.{name.partition('/')[0]}"
        try:
            found[name] = path.read_text(encoding="utf-8")
        except OSError:
            raise SetupError(f"there is no file {path}; copy the whole package to {folder}") from None
        types = USED_TYPE.findall(found[name])
        uses = {f"msg/{used}" for package, used in types if package in {"", folder.name}}
        wanted += sorted(uses - {*found, *wanted})
    return found


def _import_class(name: str) -> Any:
    package, kind, plain = name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), plain)
    except (AttributeError, ModuleNotFoundError):
        where = Path(importlib.import_module(package).__file__ or "").parent
        mend = "add the file and build the package again"
        raise SetupError(f"the package {package} in {where} lacks {plain}.{kind}; {mend}") from None


def _check_action(name: str, definition: str) -> Any:
    spec = _import_class(name)
    for part, fields in zip((spec.Goal, spec.Result), fields_of(definition)):
        installed = list(part.get_fields_and_field_types())
        if installed != fields:
            has, needs = (", ".join(names) or "none" for names in (installed, fields))
            raise SetupError(f"{name} has the fields {has}, but {needs} are needed; build its package again")
    return spec


def build_package(package: str, definitions: Definitions, tell: ProgressListener = lambda _: None) -> Path:
    """Return a folder for sys.path that contains a package with these types, building it the first time.

    Raises:
        SetupError: a required package or a compiler is missing, or the build fails.
    """
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)  # the prefix of ROS from wheels
    from ament_index_python import PackageNotFoundError
    from ament_index_python import get_package_share_directory as share

    used = {name for text in definitions.values() for name, _ in USED_TYPE.findall(text)} - {"", package}
    needed = sorted({*ACTION_PACKAGES, *used})
    try:
        shares = {name: Path(share(name)) for name in (*needed, *("rosidl_" + name for name in GENERATORS))}
    except PackageNotFoundError as error:
        lacks = f"needs the ROS 2 package {error}, which is not installed"
        raise SetupError(f"{package} {lacks}; source its workspace") from None
    versions = [(folder / "package.xml").read_text() for folder in shares.values()]
    parts = [package, definitions, sysconfig.get_config_var("SOABI"), versions, Path(__file__).read_text()]
    key = hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "codebotler" / "ros2"
    folder = home / f"{package}-{key}"
    if folder.exists():
        return folder
    missing = [name for name in COMPILERS.values() if shutil.which(name) is None]
    if missing:
        mend = f"install g++, or build {package} with colcon and source it"
        raise SetupError(f"{package} must be compiled once, but there is no {missing[0]}; {mend}")
    tell(f"building the ROS 2 messages of {package} once; this takes half a minute")
    home.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=str(home)) as temporary:
        _Build(package, Path(temporary), shares, needed).make(definitions)
        try:
            (Path(temporary) / "kept").rename(folder)
        except OSError:  # another worker was faster
            if not folder.exists():
                raise
    return folder


class _Build:
    """Builds the parts of a package that rclpy needs, as the CMake functions of ROS do."""

    def __init__(self, package: str, work: Path, shares: dict[str, Path], needed: list[str]) -> None:
        self.package, self.work, self.shares, self.needed = package, work, shares, needed
        self.made = work / "made" / package
        self.introspection = work / "introspection" / package  # a separate folder, since file names collide
        self.prefixes = {shares[name].parents[1] for name in needed}

    def make(self, definitions: Definitions) -> None:
        (self.made / "msg").mkdir(parents=True)
        preload = PRELOAD_CODE.format(package=self.package, supports=TYPE_SUPPORTS)
        (self.made / "__init__.py").write_text(preload)
        self._generate(definitions)
        module = f"{self.package}_s__rosidl_typesupport_c{sysconfig.get_config_var('EXT_SUFFIX')}"
        includes = [argument for folder in self._includes() for argument in ("-I", str(folder))]
        libraries = [f"-l{name}__rosidl_{kind}" for name in self.needed for kind in GENERATORS[1:]]
        self._run(
            "cc", "-shared", "-s", "-fPIC", "-O0", "-w", *includes, *map(str, list(self._units())), "-o",
            str(self.made / module), f"-Wl,--allow-shlib-undefined,-soname,{module},--no-as-needed",
            *(f"-L{prefix / 'lib'}" for prefix in self.prefixes), *libraries, "-lstdc++"
        )  # fmt: skip
        libraries = [f"lib{self.package}__{support}.so" for support in TYPE_SUPPORTS]
        for library in libraries:  # an empty library that links to the symbols of the module
            self._run(
                "c++", "-shared", f"-Wl,-soname,{library}", "-Wl,--no-as-needed", "-Wl,-rpath,$ORIGIN",
                "-Wl,--allow-shlib-undefined", str(self.made / module), "-o", str(self.made / library)
            )  # fmt: skip
        sources = shutil.ignore_patterns("detail", "*.[ch]", "*.idl", "*.json")
        shutil.copytree(str(self.made), str(self.work / "kept" / self.package), ignore=sources)

    def _generate(self, definitions: Definitions) -> None:
        from rosidl_adapter import convert_to_idl
        from rosidl_adapter.parser import InvalidSpecification
        from rosidl_generator_c.cli import GenerateC
        from rosidl_generator_py.cli import GeneratePython
        from rosidl_typesupport_c.cli import GenerateCTypesupport
        from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
        from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport

        for name, text in definitions.items():
            source = self.work / f"{name}.{name.partition('/')[0]}"
            source.parent.mkdir(exist_ok=True)
            source.write_text(text, encoding="utf-8")
            try:
                convert_to_idl(self.work, self.package, source.relative_to(self.work), self.made)
            except InvalidSpecification as error:
                raise SetupError(f"{self.package}/{name} is not a ROS 2 definition: {error}") from None
        files = [f"{self.made}:{name}.idl" for name in sorted(definitions)]
        includes = [str(self.shares[name]) for name in self.needed]
        for generator, folder in (
            (GenerateC("c"), self.made),
            (GenerateFastRTPSCTypesupport("fastrtps_c"), self.made),
            (GenerateCTypesupport("c", typesupport_implementations=list(TYPE_SUPPORTS)), self.made),
            (GenerateIntrospectionCTypesupport("introspection_c"), self.introspection),
            (GeneratePython("py", typesupport_implementations=["rosidl_typesupport_c"]), self.made),
        ):
            generator.generate(self.package, files, includes, output_path=folder)

    def _units(self) -> Iterator[Path]:
        """Yield the files to compile: descriptions, whose names collide, and one that includes all others."""
        for suffix in COMPILERS:
            files = sorted(self.work.rglob("*" + suffix))
            together = [path for path in files if not path.stem.endswith("__description")]
            unit = self.work / ("all" + suffix)
            unit.write_text("".join(f'#include "{path}"\n' for path in together))
            yield unit
            yield from (path for path in files if path not in together)

    def _includes(self) -> list[Path]:
        from numpy import get_include

        headers = [prefix / "include" for prefix in self.prefixes]
        of_packages = [path for each in headers for path in each.iterdir() if (path / path.name).is_dir()]
        ours, python = [self.made.parent, self.introspection.parent], sysconfig.get_paths()["include"]
        return [*ours, *headers, *of_packages, Path(python), Path(get_include())]

    def _run(self, *command: str) -> None:
        done = subprocess.run(  # noqa: S603 - the compiler, with generated files
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
        )
        if done.returncode:
            lines: Sequence[str] = done.stdout.splitlines() or [""]
            error = next((line for line in lines if "error" in line), lines[-1])
            why = f"{self.package} could not be compiled ({error.strip()})"
            raise SetupError(f"{why}; is python3-dev installed?")
