"""The pages for users: every command on them runs, in their order, as it stands there."""

import csv
import os
import re
import runpy
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from codebotler.mission import State
from codebotler.missionview import WORDS
from server import Server

DOCS = Path(__file__).parent.parent / "docs"


def run(commands: str, folder: Path, url: str) -> str:
    """Run what a reader would paste, with a model that answers quickly, and fewer completions."""
    for name in ("roboeval", "codebotler"):
        here = f"{shlex.quote(sys.executable)} -m {name}.cli"
        commands = commands.replace(f".venv/bin/{name}", here)
    commands = commands.replace("http://localhost:8000/v1", url)
    commands = commands.replace("--num-completions 50", "--num-completions 1 --tasks LunchTime")
    ended = subprocess.run(
        ["bash", "-e", "-o", "pipefail", "-c", commands],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "COLUMNS": "100"},
    )
    assert ended.returncode == 0, (commands, ended.stderr)
    return ended.stdout


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", (DOCS / page).read_text(), re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("page", ["evaluate-your-model.md", "check-before-you-run.md"])
def test_every_command_of_a_page_runs(tmp_path: Path, page: str) -> None:
    with Server(answer=lambda _: 'def task_program():\n    go_to("kitchen")\n    say("hello")\n') as server:
        printed = [run(commands, tmp_path, server.url) for commands in blocks(page, "sh")]
        assert server.requests
    assert all(printed[:1])
    for code in blocks(page, "python"):
        subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)


def test_every_command_about_robots_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CODEBOTLER_HOME", str(tmp_path / "state"))
    (tmp_path / "examples").symlink_to(DOCS.parent / "examples")
    kinds, tea, _, shown = [run(commands, tmp_path, "") for commands in blocks("robots.md", "sh")]
    assert re.search(r"^sim +works", kinds, re.MULTILINE)
    assert 'looks for "ann"\n            → found' in tea
    assert "has no stapler" in shown
    assert (tmp_path / "tea.mcap").exists()
    (code,) = blocks("robots.md", "python")
    ended = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, check=True, capture_output=True, text=True
    )
    assert ended.stdout.splitlines()[-1] == "done"


def test_states_and_events_of_missions_are_documented() -> None:
    states, _, lines = (DOCS / "robots.md").read_text().partition("### What lies on the disk")
    assert re.findall(r"^\| `(\w+)` \|", states, re.MULTILINE) == [
        *(
            state
            for state in State
            if state not in {State.DONE, State.FAILED, State.STOPPED, State.INTERRUPTED}
        ),
        *(State.DONE, State.FAILED, State.STOPPED, State.INTERRUPTED),
    ]
    rows = dict(re.findall(r"^\| `(\w+)` \|(.*)", lines, re.MULTILINE))
    assert set(re.findall(r"`(\w+)`", rows["event"])) == set(WORDS)


def test_every_command_about_reports_runs_and_every_number_is_explained(tmp_path: Path) -> None:
    printed = [run(commands, tmp_path, "") for commands in blocks("report.md", "sh")]
    told = [block for block in blocks("report.md", "text") if "drawn at random" in block]
    assert told
    assert all(any(block.strip() in out for out in printed) for block in told)
    page = (DOCS / "report.md").read_text()
    made = {path.stem for path in (tmp_path / "report").glob("*/*")}
    assert len(made) > 10
    assert set(re.findall(r"^\| `([\w-]+)` \|", page, re.MULTILINE)) >= made
    for path in (tmp_path / "report" / "tables").iterdir():
        with path.open(newline="") as file:
            heads = next(csv.reader(file))
        assert all(f"*{head}*" in page or "recorded:" in head for head in heads), (path.name, heads)


def test_the_table_of_resampling_is_what_comes_out(tmp_path: Path) -> None:
    table = next(block for block in blocks("evaluate-your-model.md", "text") if "retries" in block)
    first, *_, last = [
        block for block in blocks("evaluate-your-model.md", "sh") if "recorded" in block and "run" in block
    ]
    run(first.strip() + " --no-report", tmp_path, "")
    assert table in run(last, tmp_path, "")


@pytest.mark.parametrize(
    "page",
    [
        "evaluate-your-model.md",
        "report.md",
        "check-before-you-run.md",
        "robots.md",
        "serve.md",
        "ros.md",
        "perception.md",
        "library.md",
    ],
)
def test_pages_are_linked(page: str) -> None:
    assert f"]({page})" in (DOCS / "index.md").read_text()
    assert f"](docs/{page})" in (DOCS.parent / "README.md").read_text()


def test_pictures_come_from_tests_and_are_quickly_loaded() -> None:
    chosen = runpy.run_path(str(DOCS.parent / "tests" / "browser" / "pictures.py"))["CHOSEN"]
    pictures = {path.stem: path for path in (DOCS / "pictures").iterdir()}
    assert sorted(pictures) == sorted(chosen)
    page = (DOCS / "serve.md").read_text()
    for name, path in pictures.items():
        assert path.stat().st_size < 150_000, name
        assert f"](pictures/{name}.png)" in page


def test_links_lead_somewhere() -> None:
    for page in DOCS.glob("*.md"):
        for target in re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text()):
            assert (page.parent / target).exists(), (page.name, target)
