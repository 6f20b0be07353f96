"""Generate ROS 2 packages that define the actions of skills, for colcon."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.core.skills.table import SkillTable

TEMPLATE = Path(__file__).with_name("ros_package_template")


def ros_packages(skills: SkillTable) -> Mapping[str, Mapping[str, str]]:
    """Return the ROS 2 packages that define the skills' actions: for each package, its file texts by path."""
    packages: dict[str, dict[str, str]] = {}
    for skill in skills.rows:
        if skill.ros is not None:
            actions = packages.setdefault(skill.ros.package, {})
            actions[f"action/{skill.ros.type}.action"] = skill.ros.definition
    for package, files in packages.items():
        names = "\n".join(f'  "{name}"' for name in sorted(files))
        for path in TEMPLATE.iterdir():
            files[path.name] = path.read_text().replace("PACKAGE", package).replace("FILES", names)
    return packages


def write_ros_packages(skills: SkillTable, folder: Path) -> list[Path]:
    """Write the ROS 2 packages that define the actions of skills, and return their folders.

    Args:
        skills: the skills, at least one with a ROS action.
        folder: the parent, such as `src` of a workspace; existing packages are overwritten.

    Raises:
        UserError: no skill has an action.
        OSError: a file cannot be written.
    """
    packages = ros_packages(skills)
    if not packages:
        raise UserError('no skill has a ROS action; add one, as in ros="lab_msgs/OpenDoor:/open_door"')
    for package, files in packages.items():
        for name, text in files.items():
            path = folder / package / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
    return [folder / package for package in packages]
