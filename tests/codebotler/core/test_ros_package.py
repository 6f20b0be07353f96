"""ROS 2 packages, generated from the actions of skills."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from codebotler.core.errors import UserError
from codebotler.core.skills.files import skills_from
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.ros_package import ros_packages, write_ros_packages
from codebotler.core.skills.table import SkillTable

ROS_FOLDER = Path(__file__).parents[3] / "ros"
OWN_SKILL = """
from codebotler import Simulation, skill

@skill(ros="lab_msgs/Mix:/mix")
def mix(sim: Simulation, name: str, share: float) -> list[int]:
    "Mix."
    return [1]
"""


def test_shipped_package_matches_the_skill_table() -> None:
    (package,) = ros_packages(SKILLS)
    folder = ROS_FOLDER / package
    shipped = {
        str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()
    }
    assert shipped == ros_packages(SKILLS)[package], "generate it again: codebotler skills --ros-package ros"
    assert len(shipped) == 2 + len(SKILLS)


def test_own_actions_get_a_package_of_their_own(tmp_path: Path) -> None:
    (tmp_path / "lab.py").write_text(OWN_SKILL)
    written = write_ros_packages(skills_from(tmp_path / "lab.py"), tmp_path / "src")
    assert {path.name for path in written} == {"robot_actions_pkg", "lab_msgs"}
    lab = tmp_path / "src" / "lab_msgs"
    expected = "string name\nfloat64 share\n---\nint64[] result\n---\n"
    assert (lab / "action" / "Mix.action").read_text() == expected
    assert ET.parse(lab / "package.xml").findtext("name") == "lab_msgs"
    assert '"action/Mix.action"' in (lab / "CMakeLists.txt").read_text()


def test_skills_without_actions_have_no_package(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no skill has a ROS action"):
        write_ros_packages(SkillTable(()), tmp_path)
    assert not list(tmp_path.iterdir())
