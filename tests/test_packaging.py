"""Archives contain every file, and the files for robots start the tool with valid options."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tarfile
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parent.parent
PACKAGING = ROOT / "packaging"
TOP_LEVEL = {
    *(
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "CITATION.cff",
        "LICENSE",
        "Makefile",
        "PKG-INFO",
        "README.md",
        ".gitignore",
        "mkdocs.yml",
        "pyproject.toml",
    ),
    *(path.name for path in ROOT.glob("constraints*.txt")),
    *(".ci", "bench", "environments", "docs", "examples", "packaging", "ros", "src", "tests", "website"),
}
"""Files and folders at the top of a source archive."""


def build_archive(kind: str, source: Path, out: Path) -> Path:
    command = [sys.executable, "-m", "hatchling", "build", "--target", kind, "--directory", str(out)]
    subprocess.run(command, cwd=source, check=True, capture_output=True)
    (path,) = out.iterdir()
    return path


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the unpacked source archive."""
    folder = tmp_path_factory.mktemp("source")
    with tarfile.open(build_archive("sdist", ROOT, folder / "dist")) as archive:
        safely = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}  # since Python 3.11.4
        archive.extractall(folder, **safely)  # type: ignore[arg-type]  # values by the names of parameters
    (unpacked,) = (path for path in folder.iterdir() if path.name != "dist")
    return unpacked


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_archive("wheel", ROOT, tmp_path_factory.mktemp("tree") / "dist")


def read_wheel(wheel: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def test_the_wheel_from_the_archive_is_the_wheel_from_the_tree(source: Path, wheel: Path) -> None:
    assert read_wheel(build_archive("wheel", source, source.parent / "wheel")) == read_wheel(wheel)
    assert {path.name for path in source.iterdir()} == TOP_LEVEL


def test_stray_files_are_not_packed(source: Path, tmp_path: Path) -> None:
    tree = tmp_path / "tree"
    shutil.copytree(source, tree)
    for stray in (".env", "program.py", "notes/secret.yaml", "office/secret.yaml", "src/.env"):
        (tree / stray).parent.mkdir(exist_ok=True)
        (tree / stray).write_text("key: sk-1")
    with tarfile.open(build_archive("sdist", tree, tmp_path / "dist")) as archive:
        packed = {name.partition("/")[2] for name in archive.getnames()}
    assert packed == {str(path.relative_to(source)) for path in source.rglob("*") if path.is_file()}


def test_wheel_contains_all_files_of_the_packages(wheel: Path) -> None:
    packed = read_wheel(wheel)
    made = {"__pycache__"}
    ours = [path for path in (ROOT / "src").rglob("*") if path.is_file() and not made & set(path.parts)]
    assert {str(path.relative_to(ROOT / "src")) for path in ours} == {
        n for n in packed if ".dist-info/" not in n
    }
    for known in (  # one file of each kind other than our own modules
        "roboeval/suites/paper/tasks/LunchTime.yaml",
        "roboeval/suites/paper/solutions/LunchTime.yaml",
        "roboeval/suites/plus/solutions/GetDrink.yaml",
        "codebotler/models/recorded/StaplerReport.yaml",
        "codebotler/robots/ros/workers/ros1_worker.py",
        "codebotler/py.typed",
    ):
        assert known in packed
    (entries,) = (text.decode() for name, text in packed.items() if name.endswith("entry_points.txt"))
    assert "codebotler = codebotler.cli.app:main" in entries
    assert "roboeval = roboeval.cli.app:main" in entries


def test_installed_wheel_judges_programs(wheel: Path, tmp_path: Path) -> None:
    pip = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--no-compile",
        "--no-index",
        "--no-deps",
        "--target",
    ]
    subprocess.run([*pip, str(tmp_path / "site"), str(wheel)], check=True, capture_output=True)
    code = "import roboeval, roboeval.cli.app as c; print(roboeval.__file__); c.main()"
    ended = subprocess.run(
        [sys.executable, "-c", code, "evaluate", "recorded:careful", "--tasks", "LunchTime"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path / "site")},
        capture_output=True,
        text=True,
        check=True,
    )
    where, *tables = ended.stdout.splitlines()
    assert Path(where).is_relative_to(tmp_path)
    assert any(line.startswith("pass@1 over all prompts: 0.900 ") for line in tables), ended.stdout


# --- completion in the shell


@pytest.mark.parametrize(
    ("name", "words", "completed"),
    [
        ("roboeval", "roboeval mu", ["mutate"]),
        ("roboeval", "roboeval tasks --li", ["--lint"]),
        ("codebotler", "codebotler virt", ["virtual-robot"]),
        ("roboeval", "roboeval evaluate runs/a --engine r", ["ray"]),
    ],
)
def test_a_shell_completes_commands_options_and_names(name: str, words: str, completed: list[str]) -> None:
    about = {"COMP_WORDS": words, "COMP_CWORD": str(len(words.split()) - 1)}
    ended = subprocess.run(
        [sys.executable, "-m", name],
        env={**os.environ, **about, f"_{name.upper()}_COMPLETE": "complete_bash"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert ended.stdout.split() == completed


@pytest.mark.parametrize("name", ["codebotler", "roboeval"])
def test_completion_script_is_valid_bash(name: str) -> None:
    command = f"{shlex.quote(sys.executable)} -m {name} --show-completion bash; true"
    shown = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=True).stdout
    assert f"_{name}_completion {name}" in shown
    subprocess.run(["bash", "-n"], input=shown, text=True, check=True)


# --- environments of the Makefile


@pytest.mark.parametrize("target", ["demo", "test-inspect"])
def test_make_refuses_a_python_that_is_too_old(tmp_path: Path, target: str) -> None:
    needed = re.search(
        r'^requires-python = ">=3\.(\d+)"', (ROOT / "pyproject.toml").read_text(), re.MULTILINE
    )
    assert needed is not None
    older = int(needed[1]) - 1
    python = tmp_path / "old python"
    claim = f"import sys; sys.version_info = (3, {older}, 9)"
    python.write_text(f'#!/bin/sh\n[ "$1" = -c ] && exec {sys.executable} -c "{claim}; $2"\nmkdir -p "$4"\n')
    python.chmod(0o755)
    names = ("VENV", "EXTRAS_VENV")
    where = [f"{name}={tmp_path / 'venv' / name}" for name in names]
    ended = subprocess.run(
        ["make", "--no-print-directory", target, f"PYTHON='{python}'", *where],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    sentence, *_ = ended.stderr.splitlines()
    assert ended.returncode == 2
    assert re.search(rf"\b3\.{older}, .*\b3\.{older + 1}\b", sentence)
    assert "PYTHON=" in sentence
    assert ended.stdout == ""
    assert {path.name for path in tmp_path.iterdir()} == {python.name}


# --- on a robot


def options(words: str) -> set[str]:
    return set(re.findall(r"--[a-z-]+", words))


def test_files_for_robots_use_existing_options() -> None:
    said = subprocess.run(
        [sys.executable, "-m", "codebotler", "serve", "--help"],
        capture_output=True,
        text=True,
        check=True,
    )
    image = (PACKAGING / "Containerfile").read_text()
    service = (PACKAGING / "codebotler.service").read_text()
    nodes = [
        node.get("args") or "" for node in ET.parse(PACKAGING / "codebotler.launch").getroot().iter("node")
    ]
    (started,) = re.findall(r"^CMD \[(.*)\]$", image, re.MULTILINE)
    (run,) = re.findall(r"^ExecStart=\S+ (.*)$", service, re.MULTILINE)
    assert len(nodes) == 2
    for words in (started.replace('"', "").replace(",", ""), run, *nodes):
        assert " serve " in f" {words} "
        assert options(words)
        assert options(words) <= options(said.stdout)
    for untested in (image, (PACKAGING / "codebotler.launch").read_text()):
        assert "UNTESTED" in untested


def test_node_drops_arguments_of_roslaunch() -> None:
    given = ["serve", "a  b", "__name:=page", "", "__log:=/x/y.log", "c"]
    ended = subprocess.run(
        [str(PACKAGING / "codebotler-node"), "-c", "import sys; print(sys.argv[1:])", *given],
        env={**os.environ, "CODEBOTLER": sys.executable},
        capture_output=True,
        text=True,
        check=True,
    )
    assert ended.stdout == "['serve', 'a  b', '', 'c']\n"


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
def test_systemd_takes_the_service(tmp_path: Path) -> None:
    text = (PACKAGING / "codebotler.service").read_text()
    path = tmp_path / "codebotler.service"
    path.write_text(
        text.replace("/opt/codebotler/bin/codebotler", "/bin/true")
    )  # systemd-analyze wants a program that exists.
    ended = subprocess.run(
        ["systemd-analyze", "verify", str(path)], capture_output=True, text=True, check=False
    )
    assert (ended.returncode, ended.stderr) == (0, "")
