"""Without extras the rest works, and a command that needs an extra says so in one sentence."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from codebotler.core.errors import EXTRAS
from forked import Forked, Server

ROOT = Path(__file__).parent.parent
PRELOADED = (
    *("codebotler.cli.programs.check", "codebotler.cli.operating.run", "codebotler.generation.generate"),
    *("codebotler.missions.session", "codebotler.robots.open", "codebotler.robots.simulated"),
    *("roboeval.cli.views.results", "roboeval.cli.views.tasks", "roboeval.evaluation.evaluate"),
    *("polars", "rich.table", "rich.live", "rich.syntax", "asyncio"),
)
"""Modules that only some of the commands import."""


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    """Start a process without the packages of any extra, from which commands are forked."""
    made = Server(missing=sorted(EXTRAS))
    yield made
    made.end()


def run_without_extras(command: str, folder: Path, server: Server) -> tuple[int, str, str]:
    """Run a command; return its status, its output and its errors."""
    name, *words = command.split()
    environment = {**os.environ, "CODEBOTLER_HOME": str(folder / "home")}
    with Forked(
        name, *words, cwd=folder, environment=environment, preload=PRELOADED, server=server
    ) as running:
        out, err = running.communicate()
        return running.wait(), out, err


@pytest.mark.parametrize(
    ("command", "extra"),
    [
        ("codebotler generate Hello --model openai-chat:gpt-5.1", "models"),
        ("codebotler generate Hello --model completions:m --base-url http://localhost:1/v1", "models"),
        ("codebotler generate Hello --model hf:m", "transformers"),
        ("codebotler run Hello --yes --world office.yaml --model openai-chat:gpt-5.1", "models"),
        ("codebotler serve --world office.yaml", "page"),
        ("codebotler mcp --world office.yaml", "mcp"),
        ("codebotler run say.py --yes --robot rosbridge --address ws://localhost:1", "robots"),
        ("codebotler run say.py --yes --robot pyrobosim --world office.yaml", "pyrobosim"),
        ("codebotler missions last --mcap a.mcap", "robots"),
        ("roboeval serve .", "page"),
        ("roboeval generate --model openai-chat:gpt-5.1", "models"),
        ("roboeval run", "report"),
        ("roboeval evaluate recorded:careful --engine ray", "ray"),
        ("roboeval report recorded:careful --out report", "report"),
    ],
)
def test_missing_extra_takes_one_sentence(command: str, extra: str, tmp_path: Path, server: Server) -> None:
    (tmp_path / "office.yaml").write_text((ROOT / "examples" / "office.yaml").read_text())
    (tmp_path / "say.py").write_text("def task_program():\n    say('hello')\n")
    status, out, err = run_without_extras(command, tmp_path, server)
    assert (status, out) == (2, ""), err
    assert f"pip install 'codebotler[{extra}]'" in err
    assert len(err.splitlines()) == 1


PAGES = f"""
import sys
for package in {sorted(package for package, extra in EXTRAS.items() if extra == "robots")}:
    sys.modules[package] = None
import codebotler.web.server, codebotler.web.page, roboeval.web.pages
"""


@pytest.mark.slow
def test_pages_need_no_other_extra() -> None:
    pytest.importorskip("nicegui", reason="the extra `page` itself is not installed")
    assert len(PAGES.split(",")) > 2
    subprocess.run([sys.executable, "-c", PAGES], check=True)


@pytest.mark.parametrize(
    "command",
    [
        "codebotler check say.py",
        "codebotler run say.py --yes --world office.yaml --speed 0",
        "codebotler missions",
        "codebotler robots",
        "roboeval tasks",
        pytest.param("roboeval evaluate recorded:careful --tasks SayGoodDay", marks=pytest.mark.slow),
        "roboeval run --model recorded:careful --tasks SayGoodDay --num-completions 1 --no-report",
    ],
)
def test_the_core_works_without_any_extra(command: str, tmp_path: Path, server: Server) -> None:
    (tmp_path / "office.yaml").write_text((ROOT / "examples" / "office.yaml").read_text())
    (tmp_path / "say.py").write_text("def task_program():\n    say('hello')\n")
    status, _, err = run_without_extras(command, tmp_path, server)
    assert status == 0, err
