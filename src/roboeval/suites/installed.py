"""Suites that other packages bring, by an entry point in the group `roboeval.suites`."""

from __future__ import annotations

from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from codebotler.core.errors import UserError


class InstalledSuite(NamedTuple):
    """A suite that an installed package declares."""

    name: str
    package: str  # with its version
    place: str  # `package` or `package.folder.folder`

    def folder(self) -> Path:
        """The folder of its suite.yaml; no code of the package is run to find it."""
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
            f'the package {self.package} says that its suite "{self.name}" is {self.place}, but {missing}; '
            "install it again, or name a folder with --suite"
        )


def installed_suites() -> list[InstalledSuite]:
    """The suites of installed packages, sorted by name; two may have the same one."""
    suites = []
    for point in entry_points(group="roboeval.suites"):
        package = "of unknown name" if point.dist is None else f"{point.dist.name} {point.dist.version}"
        suites.append(InstalledSuite(point.name, package, point.value.strip()))
    return sorted(suites)


def installed_folder(name: str) -> Path | None:
    """The folder of a suite that a package brings; None if no package does.

    Raises UserError if several packages bring one, or a folder here has the same name.
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
            f'"{name}" is a suite of the package {suites[0].package} and a folder here; '
            f"write ./{name} for the folder, or change the directory for the package"
        )
    return suites[0].folder()
