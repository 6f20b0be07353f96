"""Suites that other packages bring, by an entry point in the group `roboeval.suites`."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path

from codebotler.badinput import BadInput

GROUP = "roboeval.suites"


@dataclass(frozen=True)
class InstalledSuite:
    """A suite that an installed package declares.

    Args:
        name: by which it is asked for, and that its suite.yaml must have as well.
        package: that brings it, with its version.
        place: where it lies, as `package` or `package.folder.folder`.
    """

    name: str
    package: str
    place: str

    def folder(self) -> Path:
        """Where its suite.yaml lies. No code of the package is run to find out.

        Raises:
            BadInput: it is not there.
        """
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
        raise BadInput(
            f'the package {self.package} says that its suite "{self.name}" is {self.place}, but {missing}; '
            "install it again, or name a folder with --suite"
        )


def installed_suites() -> list[InstalledSuite]:
    """The suites of installed packages, by name; two may have the same one."""
    suites = []
    for point in entry_points(group=GROUP):
        package = "of unknown name" if point.dist is None else f"{point.dist.name} {point.dist.version}"
        suites.append(InstalledSuite(point.name, package, point.value.strip()))
    return sorted(suites, key=lambda suite: (suite.name, suite.package))


def installed_folder(name: str) -> Path | None:
    """The folder of the suite that a package brings by a name; None if no package does.

    Raises:
        BadInput: several packages bring one of this name, a folder here has it, too, or it is not there.
    """
    suites = [suite for suite in installed_suites() if suite.name == name]
    if not suites:
        return None
    if len(suites) > 1:
        packages = " and ".join(f"{suite.package} ({suite.place})" for suite in suites)
        raise BadInput(
            f'several packages have a suite "{name}": {packages}; uninstall all but one, '
            "or name a folder with --suite"
        )
    if (Path(name) / "suite.yaml").is_file():
        raise BadInput(
            f'"{name}" is a suite of the package {suites[0].package} and a folder here; '
            f"write ./{name} for the folder, or go elsewhere for the package"
        )
    return suites[0].folder()
