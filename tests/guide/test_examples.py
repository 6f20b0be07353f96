"""Every example runs and prints its result."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
SHOWS = {
    "agent_loop.py": "the mission is stopped\n",
    "api_client.py": "problems: []\n",
    "judge_a_program.py": "looks_into_every_lab: the robot went to sam's lab at step 1 but did not look",
    "run_a_program.py": "finished\ngoto: kitchen\ncheck: mug\nsay: True\n",
    "rtl.py": 'the robot never said anything with "lobby"',
    "toy_policy.py": "            say('good day')\n\nits reward: 1.0\n",
}


def test_every_example_is_listed() -> None:
    assert {path.name for path in EXAMPLES.glob("*.py")} == set(SHOWS)


@pytest.mark.parametrize("name", SHOWS)
def test_example_prints_its_result(name: str, tmp_path: Path) -> None:
    command = [sys.executable, str(EXAMPLES / name)]
    apart = os.environ | {"CODEBOTLER_HOME": str(tmp_path)}  # where no other tool uses the robot
    ended = subprocess.run(command, capture_output=True, text=True, check=False, env=apart)
    assert ended.returncode == 0, ended.stderr
    assert SHOWS[name] in ended.stdout
