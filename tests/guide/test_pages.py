"""Every command and all code on the pages for users runs unchanged, in the order of the page.

Marks name the blocks that cannot run here, `<!-- not run: WHY -->` or `<!-- run by TEST -->`; lists follow.
"""

import csv
import doctest
import json
import os
import re
import runpy
import shutil
import stat
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
import yaml

from codebotler.missions.display.wording import _EVENT_WORDERS
from codebotler.missions.storage.log import MissionState
from forking_shell import forking
from server import Server

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = {path.name: path for path in (ROOT / "README.md", *sorted(DOCS.glob("*.md")))}

NOT_RUN = {
    "README.md": ["makes an environment of its own"],
    "evaluate-your-model.md": [
        *("needs a key, and costs money", "needs a model behind it", "needs Inspect, and a model behind it"),
        *("needs a key, and costs money", "needs Inspect, and a model behind it", "needs a Ray cluster"),
        *("needs a key, and costs money", "an MCP client starts it"),
    ],
    "house-rules.md": ["needs a model behind it", "needs Inspect, and a model behind it"],
    "index.md": ["makes an environment of its own"],
    "install.md": ["makes an environment of its own", "makes an environment of its own"],
    "roboeval-plus.md": ["takes minutes"],
    "mcp.md": [*["needs a client"] * 3, "needs a person"],
    "robots.md": [
        "needs pyrobosim, with which `make test-pyrobosim` tests the robot",
        "needs a mission that ended early",
    ],
    "ros1.md": ["needs root, and a Debian or Ubuntu"],
    "serve.md": ["needs a running server"],
    "training.md": [
        *("needs a model behind it", "needs a model behind it", "needs a model behind it"),
        "needs a package of its own",
    ],
    "tutorial.md": ["makes an environment of its own"],
}
"""Reasons of all blocks that are not run, page by page."""

RUN_BY = {"library.md": "tests/test_library.py"}
"""Pages that another test runs as a whole."""

SHORTER = {
    "README.md": [
        ("--num-completions 3", "--num-completions 1 --tasks LunchTime --no-report"),
        ("roboeval serve ", "roboeval serve --help "),  # Other pages serve.
        ("codebotler serve ", "codebotler serve --help "),
    ],
    "benchmark-pages.md": [("--num-completions 3", "--num-completions 1 --tasks LunchTime --no-report")],
    "evaluate-your-model.md": [
        ("--num-completions 3\n", "--num-completions 3 --no-report\n"),
        ("--num-completions 50", "--num-completions 1 --tasks LunchTime"),
        ("clarify runs/recorded-hasty --candidates 3", "clarify runs/again --candidates 2"),
    ],
    "index.md": [("recorded:hasty", "recorded:hasty --tasks LunchBreak")],
    "report.md": [
        ("--out runs/hasty-4\n", "--out runs/hasty-4 --no-report\n"),
        ("--num-completions 4", "--num-completions 4 --tasks LunchTime,LunchBreak,SetTemperature"),
    ],
    "roboeval-plus.md": [("--worlds 200", "--worlds 31"), ("--num-completions 3", "--num-completions 1")],
    "tutorial.md": [("--num-completions 2", "--num-completions 1 --tasks LunchTime --no-report")],
}
"""Parts of commands on pages, and shorter replacements, which save time here."""

JOURNEY = ("README.md", "index.md", "tutorial.md")
"""Pages that a reader follows in this order and in one folder; each other page has its own folder."""

FOLLOWED_PAGES = [page for page in PAGES if page not in RUN_BY]
CODE, DATA = {"sh", "python"}, {"yaml", "json", "text", "nginx", "caddy"}
COMMAND = re.compile(r"^(?:\.venv/|codebotler |roboeval |python |pip |export |make |apt)", re.MULTILINE)
MODEL = "http://localhost:8000/v1"

SHIM = """\
#!{python} -IS
import json, os, re, signal, socket, sys
command = [{python!r}, "-m", "{name}", *sys.argv[1:]]
if "--show-completion" in sys.argv:  # It asks what shell has started it.
    os.execv(command[0], command)
if sys.argv[1:2] != ["serve"] or "--help" in sys.argv:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as line:
        line.connect({address!r})
        job = {{"words": command[2:], "cwd": os.getcwd(), "env": dict(os.environ)}}
        socket.send_fds(line, [json.dumps(job).encode()], [0, 1, 2])
        sys.exit(int(line.recv(10)))
import subprocess, urllib.error, urllib.request
with socket.create_server(("127.0.0.1", 0)) as free:
    port = str(free.getsockname()[1])
page = subprocess.Popen([*command, "--port", port], stderr=subprocess.PIPE, text=True)
try:
    link = next(line.strip() for line in page.stderr if "http://" in line)
    link = re.sub(r"//[^/]*", "//127.0.0.1:" + port, link)
    browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    for again in range(5):  # A busy machine may answer too late.
        try:
            browser.open(link, timeout=30)
            break
        except urllib.error.HTTPError as error:
            if error.code != 500 or again == 4:
                raise
    page.send_signal(signal.SIGINT)
    sys.exit(0 if page.wait(30) in (0, 130) else 1)
finally:
    page.kill()
"""
"""Replaces a command by one that is forked. A page it serves, opens like a browser, and ends with Ctrl-C."""

PIP = """\
#!{python}
import os, sys
offline = ["--quiet", "--no-compile", "--no-index", "--no-deps", "--no-build-isolation", "--target", {site!r}]
os.execv(sys.executable, [sys.executable, "-m", "pip", *sys.argv[1:], *offline])
"""


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    language: str
    text: str
    not_run: str = ""
    run_by: str = ""


MARK = r"<!-- (?:not run: (?P<why>.*?)|run by (?P<test>.*?)) -->\n"
FENCE = re.compile(rf"^(?:{MARK})?```(?P<language>.*)\n(?P<text>(?s:.*?))^```$", re.MULTILINE)


def blocks(page: str) -> list[Block]:
    found = FENCE.finditer(PAGES[page].read_text())
    return [Block(f["language"], f["text"], f["why"] or "", f["test"] or "") for f in found]


def pages_with(is_meant: Callable[[Block], bool]) -> list[object]:
    """Return the followed pages that have a block of a kind; `journey:` marks pages that share a reader."""
    pages = [page for page in FOLLOWED_PAGES if any(map(is_meant, blocks(page)))]
    return [pytest.param(page, id=f"journey:{page}" if page in JOURNEY else page) for page in pages]


@dataclass
class Reader:
    """A reader who runs all blocks of a page, in a separate folder."""

    folder: Path
    url: str
    address: Path
    printed: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        if not (self.folder / "examples").exists():
            (self.folder / "examples").symlink_to(ROOT / "examples")
        for name in ("roboeval", "codebotler"):
            self.install(name, SHIM.format(python=sys.executable, name=name, address=str(self.address)))
        self.install("pip", PIP.format(python=sys.executable, site=str(self.folder / "site")))

    def install(self, name: str, script: str) -> None:
        path = self.folder / ".venv" / "bin" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(script)
        path.chmod(path.stat().st_mode | stat.S_IXUSR)

    def follow(self, page: str) -> None:
        for block in blocks(page):
            if block.language not in CODE or block.not_run or block.run_by or ">>> " in block.text:
                continue
            text = block.text.replace(MODEL, self.url)
            for long, short in SHORTER.get(page, []):
                text = text.replace(long, short)
            # ":" keeps the shell running during the last command, which may ask what shell started it.
            shell = ["bash", "-e", "-o", "pipefail", "-c", f"{text}:"]
            self.run(shell if block.language == "sh" else [sys.executable, "-c", text])

    def run(self, command: list[str]) -> str:
        path = os.pathsep.join([str(self.folder / "site"), os.environ.get("PYTHONPATH", "")])
        about = {"COLUMNS": "160", "CODEBOTLER_HOME": str(self.folder / "state"), "PYTHONPATH": path}
        ended = subprocess.run(
            command,
            cwd=self.folder,
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, **about},
            timeout=300,
        )
        assert ended.returncode == 0, (command[-1], ended.stdout, ended.stderr)
        self.printed.append(ended.stdout)
        return ended.stdout


@pytest.fixture(scope="session")
def follow(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[str], Reader]]:
    """Return a function that follows a page once for all tests, with a model that answers quickly."""
    readers: dict[str, Reader] = {}
    address = tmp_path_factory.mktemp("forking") / "door"
    answer = 'def task_program():\n    go_to("kitchen")\n    say("hello")\n'
    with Server(answer=lambda _: answer) as server, forking(address):

        def follow(page: str) -> Reader:
            if page not in readers:
                before = JOURNEY[: JOURNEY.index(page)] if page in JOURNEY else ()
                folder = follow(before[-1]).folder if before else tmp_path_factory.mktemp("reader")
                readers[page] = Reader(folder, server.url, address)
                readers[page].follow(page)
            return readers[page]

        yield follow


@pytest.mark.parametrize("page", pages_with(lambda block: block.language == "sh"))
def test_git_ignores_files_that_a_page_writes_into_the_root(
    follow: Callable[[str], Reader], page: str, tmp_path: Path
) -> None:
    """Packing and linters leave out the files that git ignores."""
    ours = {".venv", "examples", "site", "state"}
    for path in follow(page).folder.iterdir():
        if path.name not in ours:
            (shutil.copytree if path.is_dir() else shutil.copy)(path, tmp_path / path.name)
    shutil.copy(ROOT / ".gitignore", tmp_path)
    git = ["git", "-C", str(tmp_path)]
    subprocess.run([*git, "init", "--quiet"], check=True)
    seen = subprocess.run([*git, "status", "--porcelain"], check=True, capture_output=True, text=True)
    assert seen.stdout == "?? .gitignore\n"


OUTPUT = re.compile(r"(?:--out|--mcap|(?<![<>=-])>|mkdir(?: -p)?|--new \S+ --suite) ?([\w./-]+)")
"""The file or folder that a command makes."""


def outputs_of(text: str) -> Iterator[tuple[str, str]]:
    """Yield each file that commands in a string make, and its command without a trailing comment."""
    for line in text.replace("\\\n", " ").splitlines():
        command = " ".join(line.partition("   # ")[0].split())
        program = re.search(r"(?:codebotler|roboeval) .*|(?:cat|mkdir) .*", command)
        if program is not None:
            files = OUTPUT.findall(command)
            if not files and (model := re.search(r"roboeval (?:run|generate) --model ([\w:-]+)", command)):
                files = [f"runs/{model[1].replace(':', '-')}"]
            yield from ((file, program[0]) for file in files)


def commands_of(page: str) -> Iterator[str]:
    """Yield the commands of a page, from its shell blocks and its sentences."""
    yield from (block.text for block in blocks(page) if block.language == "sh")
    yield from re.findall(r"(?<!`)`(roboeval [^`]+)`", FENCE.sub("", PAGES[page].read_text()))


def test_pages_make_files_of_the_same_name_only_by_the_same_command() -> None:
    """A reader who follows both in one folder must not find a run with other completions."""
    makers: dict[str, dict[str, set[str]]] = {}
    demo = (ROOT / "Makefile").read_text().replace("$(BIN)", ".venv/bin").replace('"', "")
    for place, texts in [("Makefile", [demo]), *((page, commands_of(page)) for page in PAGES)]:
        for file, command in (one for text in texts for one in outputs_of(text)):
            alone = (
                f" on {place}" if command.startswith("cat >") else ""
            )  # The text to write is not in the command.
            makers.setdefault(file, {}).setdefault(place, set()).add(command + alone)
    assert {"Makefile", "index.md"} <= makers["runs/hasty"].keys()
    assert {"runs/first-model", "runs/recorded-hasty", "first.py", "office"} <= makers.keys()
    shared = {file: pages for file, pages in makers.items() if len(pages) > 1}
    assert {file: pages for file, pages in shared.items() if len(set.union(*pages.values())) > 1} == {}


def is_printed(text: str, printed: str) -> bool:
    """Return whether a command printed a text, except for line breaks; `...` stands for any text."""
    text, printed = (" ".join(each.split()) for each in (text, printed))
    return re.search(re.escape(text).replace(r"\.\.\.", ".*?"), printed) is not None


@pytest.mark.parametrize("page", pages_with(lambda block: block.language in CODE))
def test_every_block_of_a_page_runs(follow: Callable[[str], Reader], page: str) -> None:
    follow(page)


def test_blocks_that_are_not_run_are_marked_and_listed() -> None:
    marked = {page: [block.not_run for block in blocks(page) if block.not_run] for page in PAGES}
    assert {page: reasons for page, reasons in marked.items() if reasons} == NOT_RUN
    assert all(page in (ROOT / test).read_text() for page, test in RUN_BY.items())
    for page, path in PAGES.items():
        assert path.read_text().count("\n```") == 2 * len(blocks(page)), page
        for block in blocks(page):
            assert block.language in CODE | DATA, (page, block)
            assert block.language == "sh" or not COMMAND.search(block.text), (page, block)
            assert not block.run_by or page in (ROOT / block.run_by).read_text(), (page, block)


def test_examples_in_sessions_of_python_run() -> None:
    for page, path in PAGES.items():
        if any(block.text.startswith(">>> ") for block in blocks(page)):
            results = doctest.testfile(str(path), module_relative=False, encoding="utf-8")
            assert (results.failed, results.attempted > 10) == (0, True), page


def test_data_can_be_read() -> None:
    read: dict[str, Callable[[str], object]] = {"yaml": yaml.safe_load, "json": json.loads}
    for page in PAGES:
        for block in blocks(page):
            if block.language in read:
                assert read[block.language](block.text), (page, block)


SHOWN_ELSEWHERE = {  # No command of the page prints these texts.
    "architecture.md": ["roboeval\n  cli/"],
    "check-before-you-run.md": ["Which did you mean?"],  # test_candidates.py shows it on a terminal.
    "index.md": ["abc argparse", "runs/hasty/"],
    "roboeval-plus.md": ["task   "],
    "ros.md": ["string location"],
}


@pytest.mark.parametrize("page", pages_with(lambda block: block.language == "text"))
def test_commands_print_the_output_that_a_page_shows(follow: Callable[[str], Reader], page: str) -> None:
    elsewhere = tuple(SHOWN_ELSEWHERE.get(page, []))
    texts = [block.text for block in blocks(page) if block.language == "text"]
    assert sum(text.startswith(elsewhere) for text in texts) >= len(elsewhere)
    for text in texts:
        if not (elsewhere and text.startswith(elsewhere)):
            assert any(is_printed(text, printed) for printed in follow(page).printed), text


def test_architecture_names_existing_files_and_functions() -> None:
    page, _, _ = (ROOT / "docs" / "architecture.md").read_text().partition("## All modules")
    _, steps = page.split("## From a reply to a verdict")
    rows = [re.findall("`([^`]+)`", line) for line in steps.splitlines() if line.startswith("|")]
    files = {str(path.relative_to(ROOT / "src")): path.read_text() for path in (ROOT / "src").rglob("*.py")}
    for named in filter(None, rows):
        places = [place for place in named if place.endswith(".py")]
        assert all(any(f"/{path}".endswith(f"/{place}") for path in files) for place in places), named
        text = "\n".join(text for path, text in files.items() if path.endswith(tuple(places)))
        for name in named if places else ():
            line = rf"^ *(async )?(def |class )?{name}\b"
            assert not name.isidentifier() or re.search(line, text, re.MULTILINE), name


@pytest.mark.parametrize("page", ["robots.md"])
def test_commands_about_robots_print_their_results(follow: Callable[[str], Reader], page: str) -> None:
    reader = follow(page)
    kinds, tea, *_, shown, code = reader.printed
    assert re.search(r"^sim +works", kinds, re.MULTILINE)
    assert 'looks for "ann"\n            → found' in tea
    assert "has no stapler" in shown
    assert (reader.folder / "tea.mcap").exists()
    assert code.splitlines()[-1] == "done"


@pytest.mark.parametrize("page", ["index.md"], ids=["journey:index.md"])
def test_guide_lists_the_files_of_a_run_folder(follow: Callable[[str], Reader], page: str) -> None:
    folder = follow(page).folder / "runs" / "hasty"
    (listed,) = (b.text for b in blocks("index.md") if b.text.startswith("runs/hasty/"))
    names = set(re.findall(r"^  (\S+)", listed, re.MULTILINE))
    made = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    assert made <= names
    assert {"completions.jsonl", "evaluations/paper.jsonl"} <= made


@pytest.mark.parametrize("page", ["write-a-task.md"])
def test_task_of_the_guide_becomes_a_package(
    follow: Callable[[str], Reader],
    page: str,
) -> None:
    reader = follow(page)
    assert "an umbrella is in the lobby" in reader.printed[-1]
    assert not (reader.folder / "office").exists()
    assert (reader.folder / "site" / "office_suite" / "suite.yaml").is_file()
    judged = next(printed for printed in reader.printed if "FetchUmbrella/1/0" in printed)
    assert "there is only a chair in the lobby" in judged


def test_states_and_events_of_missions_are_documented() -> None:
    states, _, lines = (DOCS / "robots.md").read_text().partition("### On the disk")
    assert re.findall(r"^\| `(\w+)` \|", states, re.MULTILINE) == [
        *(
            state
            for state in MissionState
            if state
            not in {MissionState.DONE, MissionState.FAILED, MissionState.STOPPED, MissionState.INTERRUPTED}
        ),
        *(MissionState.DONE, MissionState.FAILED, MissionState.STOPPED, MissionState.INTERRUPTED),
    ]
    rows = dict(re.findall(r"^\| `(\w+)` \|(.*)", lines, re.MULTILINE))
    assert set(re.findall(r"`(\w+)`", rows["event"])) == set(_EVENT_WORDERS)


@pytest.mark.parametrize("page", ["report.md"])
def test_every_number_of_a_report_is_explained(follow: Callable[[str], Reader], page: str) -> None:
    report = follow(page).folder / "report"
    text = (DOCS / page).read_text()
    made = {path.stem for path in report.glob("*/*")}
    assert len(made) > 10
    assert set(re.findall(r"^\| `([\w-]+)` \|", text, re.MULTILINE)) >= made
    for path in (report / "tables").iterdir():
        with path.open(newline="") as file:
            heads = next(csv.reader(file))
        assert all(f"*{head}*" in text or "recorded:" in head for head in heads), (path.name, heads)


@pytest.mark.parametrize("page", [page for page in PAGES if page not in {"README.md", "index.md"}])
def test_pages_are_linked(page: str) -> None:
    assert f"]({page})" in (DOCS / "index.md").read_text()
    assert f"](docs/{page})" in (ROOT / "README.md").read_text()


def test_pictures_are_chosen_shown_and_small() -> None:
    chosen = runpy.run_path(str(ROOT / "tests" / "browser" / "pictures.py"))["CHOSEN"]
    pictures = {path.stem: path for path in (DOCS / "pictures").glob("*.png")}
    assert sorted(pictures) == sorted(chosen)
    pages = [path.read_text() for path in PAGES.values()]
    for name, path in pictures.items():
        assert path.stat().st_size < 150_000, name
        in_markdown, in_html = (
            rf"!\[[^]]{{20,}}\]\(pictures/{name}\.png\)",
            rf'src(?:set)?="docs/pictures/{name}\.png"',
        )
        assert any(re.search(f"{in_markdown}|{in_html}", page) for page in pages), name


def test_this_project_is_installed_from_its_folder() -> None:
    """Given only its name, pip would look for it among published packages."""
    readmes = {f"environments/{path.parent.name}": path for path in ROOT.glob("environments/*/README.md")}
    for page, path in {**PAGES, **readmes}.items():
        assert not re.findall(r"pip install [^`\n]*\bcodebotler\b(?!-\d)", path.read_text()), page


def test_links_lead_somewhere() -> None:
    for page, path in PAGES.items():
        for target in re.findall(r"\]\((?!https?:)([^)#]+)", path.read_text()):
            assert (path.parent / target).exists(), (page, target)
