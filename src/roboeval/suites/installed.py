"""Finds suites in other packages, by entry points in the group `roboeval.suites`."""

from __future__ import annotations

from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from codebotler.core.errors import UserError


class InstalledSuite(NamedTuple):
    """A suite that an installed package declares."""

    name: str
    package: str  # the package's name and version
    place: str  # `package` or `package.folder.folder`

    def folder(self) -> Path:
        """Find the folder that contains the suite.yaml, without running any of the package's code."""
        top, *below = self.place.split(".")
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
            f'the package {self.package} declares its suite "{self.name}" at {self.place}, but {missing}; '
            "reinstall it, or name a folder with --suite"
        )


def installed_suites() -> list[InstalledSuite]:
    """Return the suites of installed packages, sorted by name. Several may have the same name."""
    suites = []
    for point in entry_points(group="roboeval.suites"):
        package = "of unknown name" if point.dist is None else f"{point.dist.name} {point.dist.version}"
        suites.append(InstalledSuite(point.name, package, point.value.strip()))
    return sorted(suites)


def installed_folder(name: str) -> Path | None:
    """Find the folder of a suite in an installed package, or return None if no package has the suite.

    Raises UserError if several packages have it, or if a local folder has the same name.
    """
    suites = [suite for suite in installed_suites() if suite.name == name]
    if not suites:
        return None
    if len(suites) > 1:
        packages = " and ".join(f"{suite.package} ({suite.place})" for suite in suites)
        raise UserError(
            f'several packages have a suite "{name}": {packages}; uninstall all but one, '
            "or name a folder with --suite"
        )
    if (Path(name) / "suite.yaml").is_file():
        raise UserError(
            f'"{name}" is both a suite in the package {suites[0].package} and a local folder; '
            f"write ./{name} for the folder, or run the command in another folder to use the package"
        )
    return suites[0].folder()
