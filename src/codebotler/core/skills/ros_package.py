"""Generate ROS 2 packages that define the actions of skills, for colcon."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.core.skills.table import SkillTable

PACKAGE_XML = """\
<?xml version="1.0"?>
<package format="3">
  <name>{package}</name>
  <version>1.0.0</version>
  <description>Actions of a robot's skills.</description>
  <maintainer email="robot@example.com">The makers of the robot</maintainer>
  <license>MIT</license>

  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  <depend>action_msgs</depend>
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>

  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""
CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project({package})

find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)

rosidl_generate_interfaces(${{PROJECT_NAME}}
{files}
)

ament_export_dependencies(rosidl_default_runtime)
ament_package()
"""


def ros_packages(skills: SkillTable) -> Mapping[str, Mapping[str, str]]:
    """Return the files of the ROS 2 packages that define the actions of skills, by package name."""
    packages: dict[str, dict[str, str]] = {}
    for skill in skills.rows:
        if skill.ros is not None:
            actions = packages.setdefault(skill.ros.package, {})
            actions[f"action/{skill.ros.type}.action"] = skill.ros.definition
    for package, files in packages.items():
        names = "\n".join(f'  "{name}"' for name in sorted(files))
        files["package.xml"] = PACKAGE_XML.format(package=package)
        files["CMakeLists.txt"] = CMAKE.format(package=package, files=names)
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
