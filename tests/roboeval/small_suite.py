"""Write a suite of one task into a folder."""

from pathlib import Path

SUITE = "name: mine\nversion: 1\n"
TASK = """\
name: T
summary: s
prompts: [p]
checks:
  goes: {category: Location, rtl: 'tr.Exists(goto("kitchen"))'}
  says(what): {category: SayAtLocation, rtl: 'tr.Exists(say("{what}"))'}
worlds:
  - about: one
    robot: kitchen
    rooms: [kitchen]
    require: [goes, not says("bye")]
"""


def write_suite(folder: Path, task: str = TASK, suite: str = SUITE, name: str = "T.yaml") -> str:
    (folder / "tasks").mkdir()
    (folder / "suite.yaml").write_text(suite)
    (folder / "tasks" / name).write_text(task)
    return str(folder)
