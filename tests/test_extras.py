"""Two installs: without an extra the rest works, and what needs the extra says so in one sentence."""

import subprocess
import sys
from pathlib import Path

import pytest

from codebotler.core.errors import EXTRAS

ROOT = Path(__file__).parent.parent
WITHOUT = f"""
import sys
for package in {sorted(EXTRAS)}:
    sys.modules[package] = None
from {{package}}.cli.app import main
sys.argv = [{{package!r}}, *sys.argv[1:]]
main()
"""


def without_extras(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    package, *words = command.split()
    code = WITHOUT.format(package=package)
    return subprocess.run(
        [sys.executable, "-c", code, *words], cwd=folder, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    ("command", "extra"),
    [
        ("codebotler generate Hello --model openai-chat:gpt-5.1", "models"),
        ("codebotler generate Hello --model completions:m --base-url http://localhost:1/v1", "models"),
        ("codebotler generate Hello --model hf:m", "transformers"),
        ("codebotler run Hello --yes --world office.yaml --model openai-chat:gpt-5.1", "models"),
        ("codebotler serve --world office.yaml", "page"),
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
def test_a_missing_extra_is_one_sentence(command: str, extra: str, tmp_path: Path) -> None:
    (tmp_path / "office.yaml").write_text((ROOT / "examples" / "office.yaml").read_text())
    (tmp_path / "say.py").write_text("def task_program():\n    say('hello')\n")
    ended = without_extras(command, tmp_path)
    assert (ended.returncode, ended.stdout) == (2, ""), ended.stderr
    assert f"pip install 'codebotler[{extra}]'" in ended.stderr
    assert len(ended.stderr.splitlines()) == 1


PAGES = f"""
import sys
for package in {sorted(package for package, extra in EXTRAS.items() if extra == "robots")}:
    sys.modules[package] = None
import codebotler.web.server, codebotler.web.page, roboeval.web.pages
"""


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
        "roboeval evaluate recorded:careful --tasks SayGoodDay",
        "roboeval run --model recorded:careful --tasks SayGoodDay --num-completions 1 --no-report",
    ],
)
def test_the_core_works_without_any_extra(command: str, tmp_path: Path) -> None:
    (tmp_path / "office.yaml").write_text((ROOT / "examples" / "office.yaml").read_text())
    (tmp_path / "say.py").write_text("def task_program():\n    say('hello')\n")
    ended = without_extras(command, tmp_path)
    assert ended.returncode == 0, ended.stderr
