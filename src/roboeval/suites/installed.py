"""Finds suites in other packages, by entry points in the group `roboeval.suites`."""

from __future__ import annotations

from importlib.metadata import EntryPoint, EntryPoints, entry_points
from importlib.util import find_spec
from pathlib import Path

from codebotler.core.errors import UserError


def installed_suites() -> EntryPoints:
    """Return the entry points of suites in installed packages. Several may have the same name."""
    return entry_points(group="roboeval.suites")


def installed_folder(name: str) -> Path | None:
    """Find the folder of a suite in an installed package, or return None if no package has the suite.

    Raises UserError if several packages have it, or if a local folder has the same name.
    """
    points = list(installed_suites().select(name=name))
    if not points:
        return None
    packages = " and ".join(f"{_package(point)} ({point.value})" for point in points)
    if len(points) > 1:
        raise UserError(
            f'several packages have a suite "{name}": {packages}; uninstall all but one, '
            "or name a folder with --suite"
        )
    if (Path(name) / "suite.yaml").is_file():
        raise UserError(
            f'"{name}" is both a suite in the package {packages} and a local folder; '
            f"write ./{name} for the folder, or run the command in another folder to use the package"
        )
    return _folder(points[0])


def _folder(point: EntryPoint) -> Path:
    """Find the folder that contains the suite.yaml, without running any of the package's code."""
    top, *below = point.value.strip().split(".")
    try:
        spec = find_spec(top)
    except (ImportError, ValueError):
        spec = None
    found = [Path(place, *below) for place in (spec and spec.submodule_search_locations) or ()]
    for folder in found:
        if (folder / "suite.yaml").is_file():
            return folder
    missing = f"there is no suite.yaml in {found[0]}" if found else f'there is no package "{top}"'
    raise UserError(
        f'the package {_package(point)} declares its suite "{point.name}" at {point.value}, but {missing}; '
        "reinstall it, or name a folder with --suite"
    )


def _package(point: EntryPoint) -> str:
    """Return the name and the version of the package that declares a suite."""
    return "of unknown name" if point.dist is None else f"{point.dist.name} {point.dist.version}"
