"""The benchmark in a real browser: navigation, filters, live updates, and texts that stay text."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from codebotler.core.files import to_line
from codebotler.models.no_program import NO_PROGRAM_SENTENCES
from command_line import forked
from evil import EVIL, NAMES, OWN_TAGS
from pageserver import PageServer
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.suites.task import plain_check
from runs_server import serve_runs
from seals import unseal
from viewing import DESK, PHONE, SCREENS, OpenPage, Screen, Shoot, expect_no_grave_fault

TASKS = "SayGoodDay,LunchBreak,StaplerSupply"
LONGEST = 1_000
"""Longer texts are tested on a large screen, too."""


def make_run(folder: Path, model: str, *arguments: str, count: int = 3) -> Path:
    """Make a run of a recorded model; return its folder."""
    path = folder / model
    words = ("--model", f"recorded:{model}", "--num-completions", count, "--no-report", "--out", path)
    ended = forked("roboeval", "run", *map(str, words), *arguments)
    assert ended.status == 0, ended.err
    return path


def repeat_completions(run: RunFolder, times: int) -> None:
    """Repeat all completions of a run, with other indices."""
    for path in (run.completions, run.rows("paper")):
        rows = [json.loads(line) for line in path.read_bytes().splitlines()]
        most = 1 + max(row["index"] for row in rows)
        with path.open("wb") as file:
            for n in range(times):
                file.writelines(to_line({**row, "index": row["index"] + n * most}) for row in rows)
    unseal(run.path)


@pytest.fixture(scope="module")
def real_runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two real runs of all tasks."""
    folder = tmp_path_factory.mktemp("real") / "runs"
    folder.mkdir()
    make_run(folder, "hasty")
    make_run(folder, "careful", count=1)
    return folder


@pytest.fixture(scope="module")
def real_server(real_runs: Path) -> Iterator[PageServer]:
    with serve_runs(real_runs) as server:
        yield server


@pytest.fixture
def hasty_copy(real_runs: Path, tmp_path: Path) -> Path:
    """Return a folder with a copy of one real run, which a test may change."""
    folder = tmp_path / "runs"
    shutil.copytree(real_runs / "hasty", folder / "hasty")
    return folder


@pytest.fixture(scope="module")
def small_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a small run."""
    folder = tmp_path_factory.mktemp("few")
    return make_run(folder, "hasty", "--tasks", TASKS, count=1)


@pytest.fixture
def small_copy(small_run: Path, tmp_path: Path) -> Path:
    """Return a folder with a copy of the small run, which a test may change."""
    folder = tmp_path / "runs"
    shutil.copytree(small_run, folder / "hasty")
    return folder


def test_from_all_runs_to_one_failed_check(real_server: PageServer, open_page: OpenPage) -> None:
    page = open_page(real_server)
    expect(page.locator(".runs tbody tr")).to_have_count(2)
    expect(page.locator(".runs tbody tr", has_text="hasty")).to_contain_text("programs written by hand")
    for box in page.get_by_role("checkbox").all():
        box.check()
    page.get_by_role("button", name="Show side by side").click()
    expect(page.locator(".heat").first.get_by_role("row")).to_have_count(2 + 16)
    cells = page.locator(".heat").first.locator("tbody tr", has_text="LunchBreak").locator("td")
    expect(cells).to_have_count(12)
    cell = page.get_by_role("link", name=re.compile("^LunchBreak, prompt 0: 33% passed, 1 of 3"))
    expect(cell).to_have_text("33")
    cell.click()
    expect(page.get_by_role("heading", name="Completions of LunchBreak, prompt 0")).to_be_visible()
    listed = page.locator(".completions-view a")
    expect(listed).to_have_text(["LunchBreak/0/0", "LunchBreak/0/1", "LunchBreak/0/2"])
    page.locator(".kind", has_text="SayAtLocation").click()
    page.get_by_role("button", name="Show all").click()
    page.locator(".kind", has_text="SayAtLocation").click()
    expect(page.get_by_role("heading", name="Completions that ended in SayAtLocation")).to_be_visible()
    expect(page.get_by_role("heading", name="Share that ended in SayAtLocation")).to_be_visible()
    expect(page.locator("#count")).to_have_text("18 completions")
    expect(page.locator(".completions-view b").first).to_have_text("SayAtLocation")
    listed.first.click()
    expect(page.locator(".failed-check").first).to_contain_text("at step")
    expect(page.locator(".world-of")).not_to_have_count(0)
    expect(page.locator(".marked").first).to_be_visible()
    step = page.locator(".failed-check a").first
    number = step.inner_text().removeprefix("step ")
    step.click()
    expect(page.locator(":target")).to_have_attribute("data-step", number)
    expect(page.locator(":target")).to_have_class(re.compile("marked"))
    page.locator("summary", has_text="All steps").first.click()
    expect(page.locator(".unfolded pre").first).to_contain_text("→")
    page.locator("summary", has_text="The world").first.click()
    expect(page.locator(".unfolded .floorplan").first).to_be_visible()
    before = page.locator("h1").inner_text()
    page.get_by_role("link", name="Next completion").click()
    expect(page.locator("h1")).not_to_have_text(before)
    page.get_by_role("link", name="hasty").click()
    expect(page.locator("#count")).to_have_text("18 completions")


def test_page_shows_output_of_show(real_server: PageServer, real_runs: Path, open_page: OpenPage) -> None:
    shown = json.loads(forked("roboeval", "show", real_runs / "hasty", "CountSavory/0/1", "--json").out)
    page = open_page(real_server, "runs/hasty/CountSavory/0/1")
    expect(page.locator(".instruction")).to_have_text(shown["instruction"])
    program = "\n".join(page.locator(".program .line .text").all_inner_texts())
    assert program == shown["program"].rstrip("\n")
    worlds = sorted(enumerate(shown["worlds"], 1), key=lambda one: one[1]["satisfied"])
    for place, (number, world) in enumerate(worlds):
        article = page.locator(".world-of").nth(place)
        expect(article.locator("h2")).to_have_text(f"World {number} of 4: {world['world']}")
        expect(article.locator(".state")).to_have_text("satisfied" if world["satisfied"] else "not satisfied")
        expect(article.locator(".scenes")).to_have_count(0 if world["satisfied"] else 1)
        for check in world["failed_checks"]:
            expect(article.locator(".failed-check")).to_contain_text(plain_check(check["check"]))
            expect(article.locator(".failed-check")).to_contain_text(check["explanation"])


def test_a_line_that_ends_a_program_is_marked(real_server: PageServer, open_page: OpenPage) -> None:
    page = open_page(real_server, "runs/hasty/LunchBreak/0/0")
    expect(page.locator(".program .marked")).to_contain_text("go_to")
    expect(page.locator(".world-of .trouble").first).to_contain_text("there is no room")


def test_reply_without_a_program_is_explained_and_its_texts_are_folded(
    small_copy: Path, open_page: OpenPage
) -> None:
    run = RunFolder(small_copy / "hasty")
    said = {"no_program": "cut-off", "finish_reason": "length", "latency_s": 2.5}
    said |= {"usage": {"input_tokens": 900, "output_tokens": 512, "reasoning_tokens": 400}}
    said |= {"reasoning": "Let me think <b>hard</b>.", "raw_reply": "I will"}
    rows = [json.loads(line) for line in run.completions.read_bytes().splitlines()]
    written = {**rows[0], **said}
    run.completions.write_bytes(b"".join(map(to_line, [written, *rows[1:]])))
    judged = [json.loads(line) for line in run.rows("paper").read_bytes().splitlines()]
    failure = {"class": "NoProgram", "kind": "cut-off", "world": 0, "check": None}
    name = f"{written['task']}/{written['prompt']}/{written['index']}"
    for row in judged:
        if f"{row['task']}/{row['prompt']}/{row['index']}" == name:
            row |= {"passed": False, "failure": failure}
            row["verdicts"][0]["satisfied"] = False
    run.rows("paper").write_bytes(b"".join(map(to_line, judged)))
    unseal(run.path)
    with serve_runs(small_copy) as server:
        page = open_page(server, f"runs/hasty/{name}")
        expect(page.locator(".facts .state")).to_have_text("no program: cut-off")
        expect(page.locator(".worlds-of .trouble")).to_have_text(NO_PROGRAM_SENTENCES["cut-off"])
        expect(page.locator(".world-of")).to_have_count(0)
        reply = page.locator(".reply")
        expect(reply).to_contain_text("512 in the reply")
        expect(reply.locator("pre")).to_have_count(0)
        reply.locator("summary", has_text="Reasoning").click()
        expect(reply.locator("pre")).to_have_text("Let me think <b>hard</b>.")
        page.get_by_role("link", name="hasty").click()
        expect(page.locator(".kind", has_text="cut-off")).to_contain_text("1")
        page.locator(".kind", has_text="without a program").click()
        expect(page.get_by_role("heading", name="Share that ended without a program")).to_be_visible()
        page.context.close()


def test_address_keeps_the_selection(real_server: PageServer, open_page: OpenPage) -> None:
    page = open_page(real_server, "runs/hasty")
    page.get_by_role("link", name=re.compile("^SayGoodDay, prompt 3")).click()
    expect(page.locator(".completions-view a")).to_have_text([f"SayGoodDay/3/{n}" for n in range(3)])
    assert page.url.endswith("/runs/hasty?task=SayGoodDay&prompt=3")
    page.reload()
    expect(page.locator(".completions-view a")).to_have_text([f"SayGoodDay/3/{n}" for n in range(3)])
    expect(page.locator("[aria-current=true]", has_text=re.compile(r"^\d+$"))).to_have_count(1)


def test_everything_works_with_the_keyboard(real_server: PageServer, open_page: OpenPage) -> None:
    page = open_page(real_server, "runs/hasty")
    page.get_by_role("link", name=re.compile("^LunchBreak, prompt 1")).focus()
    page.keyboard.press("Enter")
    expect(page.locator("#count")).to_have_text("3 completions")
    kind = page.get_by_role("button", name=re.compile("^passed"))
    kind.focus()
    page.keyboard.press("Enter")
    expect(
        page.get_by_role("heading", name="Completions of LunchBreak, prompt 1, that passed")
    ).to_be_visible()
    expect(kind).to_be_focused()
    expect(kind).to_have_attribute("aria-pressed", "true")
    page.get_by_role("button", name="Show all").focus()
    page.keyboard.press("Space")
    expect(page.locator("#count")).to_have_text("240 completions")
    page.locator(".completions-view").focus()
    page.keyboard.press("End")
    expect(page.locator("[aria-rowindex='241'] a")).to_be_visible()
    page.locator("[aria-rowindex='241'] a").focus()
    page.keyboard.press("Enter")
    expect(page.locator("h1")).to_have_text("WeatherPoll/4/2")


def test_a_long_list_has_few_rows_in_the_page(hasty_copy: Path, open_page: OpenPage) -> None:
    repeat_completions(RunFolder(hasty_copy / "hasty"), 17)
    with serve_runs(hasty_copy) as server:
        page = open_page(server, "runs/hasty")
        expect(page.locator("#count")).to_have_text("4,080 completions")
        for share, wanted in ((1.0, 4081), (0.5, None), (0.0, 2)):
            page.locator(".completions-view").evaluate(
                "(view, share) => { view.scrollTop = share * view.scrollHeight; }", share
            )
            if wanted is not None:
                expect(page.locator(f"[aria-rowindex='{wanted}'] a")).to_be_visible()
            expect(page.locator(".completions-view .quiet")).to_have_count(0)
            assert page.locator(".completions-view .completion").count() < 60
        expect(page.locator(".completions-view a").first).to_have_text("CountSavory/0/0")
        page.context.close()


def test_a_run_is_followed_while_it_is_made(hasty_copy: Path, open_page: OpenPage) -> None:
    """Write lines in steps, as for slow replies of a model, under the lock of a writer."""
    whole, run = RunFolder(hasty_copy / "hasty"), RunFolder(hasty_copy / "growing")
    lines = {
        path: (whole.path / path).read_bytes().splitlines(keepends=True)
        for path in ("completions.jsonl", "evaluations/paper.jsonl")
    }

    def write(path: str, start: int, end: int) -> None:
        (run.path / path).parent.mkdir(exist_ok=True)
        with (run.path / path).open("ab") as file:
            file.writelines(lines[path][start:end])

    run.path.mkdir()
    shutil.copy(whole.about, run.about)
    with serve_runs(hasty_copy) as server:
        with run.writing():
            write("completions.jsonl", 0, 60)
            everything, page = open_page(server), open_page(server, "runs/growing")
            row = everything.locator(".runs tbody tr", has_text="growing")
            expect(row.locator(".state")).to_have_text("being generated")
            expect(row).to_contain_text("60 of 240 written")
            expect(page.locator(".facts .state")).to_have_text("being generated")
            expect(page.locator("progress")).to_have_attribute("value", "0.250")
            write("completions.jsonl", 60, 240)
            expect(page.locator("#count")).to_have_text("240 completions")
            shutil.copytree(whole.path / "evaluations", run.path / "evaluations")
            unseal(run.path)
            (run.path / "evaluations" / "paper.jsonl").write_bytes(b"")
            write("evaluations/paper.jsonl", 0, 100)
            expect(row.locator(".state")).to_have_text("being judged")
            expect(row).to_contain_text("100 of 240 judged")
            expect(page.locator(".facts .state")).to_have_text("being judged")
            expect(page.locator(".heat td.mean").first).not_to_have_text("-")
        expect(row.locator(".state")).to_have_text("unfinished")
        write("evaluations/paper.jsonl", 100, 240)
        expect(row.locator(".state")).to_have_text("judged")
        expect(page.locator(".facts .state")).to_have_text("judged")
        expect(page.locator(".facts b").first).to_contain_text("pass@1 0.279")
        expect(page.locator("progress")).to_be_hidden()
        for each in (page, everything):
            each.context.close()


def test_a_real_run_appears_as_it_is_made(tmp_path: Path, open_page: OpenPage) -> None:
    folder = tmp_path / "runs"
    folder.mkdir()
    with serve_runs(folder) as server:
        page = open_page(server)
        expect(page.get_by_text("There are no runs yet.")).to_be_visible()
        command = [
            "run",
            "--model",
            "recorded:hasty",
            "--num-completions",
            "2",
            "--tasks",
            TASKS,
            "--no-report",
        ]
        made = subprocess.Popen(
            [sys.executable, "-m", "roboeval", *command, "--out", folder / "new"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        row = page.locator(".runs tbody tr")
        expect(row).to_have_count(1)
        assert made.wait() == 0
        expect(row.locator(".state")).to_have_text("judged")
        expect(row.locator(".count")).to_have_text("30 of 30 judged")
        expect(row.locator(".tasks")).to_have_text("3 of 16")
        expect(row.locator(".date")).to_have_text(re.compile(r"^20\d\d-\d\d-\d\d \d\d:\d\d$"))
        expect(page.get_by_text("There are no runs yet.")).to_be_hidden()
        page.context.close()


def test_open_page_reports_that_its_run_was_deleted(small_copy: Path, open_page: OpenPage) -> None:
    with serve_runs(small_copy) as server:
        page = open_page(server, "runs/hasty", expecting="404")
        expect(page.locator("#count")).to_have_text("15 completions")
        shutil.rmtree(small_copy / "hasty")
        expect(page.get_by_role("alert")).to_have_text(re.compile("^This run was deleted"))
        expect(page.locator(".heat td").first).to_be_visible()
        page.reload()
        expect(page.get_by_role("alert")).to_contain_text('this folder has no run "hasty"')
        page.get_by_role("link", name="All runs").click()
        expect(page.get_by_text("There are no runs yet.")).to_be_visible()
        page.context.close()


def test_damaged_row_is_reported(small_copy: Path, open_page: OpenPage) -> None:
    rows = RunFolder(small_copy / "hasty").rows("paper")
    lines = rows.read_bytes().splitlines(keepends=True)
    rows.write_bytes(b"".join([*lines[:10], b"{broken\n", *lines[11:]]))
    with serve_runs(small_copy) as server:
        page = open_page(server, "runs/hasty")
        expect(page.get_by_role("alert")).to_contain_text("paper.jsonl, line 11: this line is not an eval")
        page.context.close()


def test_unknown_addresses_are_reported(real_server: PageServer, open_page: OpenPage) -> None:
    for path, sentence in (
        ("runs/none", 'this folder has no run "none"; it may have been deleted'),
        ("runs/hasty/LunchBreak/0/99", 'this run has no completion "LunchBreak/0/99"'),
        ("runs/hasty?evaluation=none", 'the run "hasty" has no evaluation "none"'),
    ):
        page = open_page(real_server, expecting="404")
        page.goto(f"{real_server.inside}/{path}")
        expect(page.get_by_role("alert")).to_have_text(sentence)


# --- hostile texts


def rewrite_run(run: RunFolder, change: Callable[[dict[str, Any], dict[str, Any]], None]) -> None:
    """Rewrite a run's completions and their rows."""
    completions = [json.loads(line) for line in run.completions.read_bytes().splitlines()]
    rows = [json.loads(line) for line in run.rows("paper").read_bytes().splitlines()]
    for completion, row in zip(completions, rows, strict=True):
        change(completion, row)
        row["program_sha256"] = sha256(completion["program"].encode(errors="surrogatepass")).hexdigest()
    run.completions.write_bytes(b"".join(map(to_line, completions)))
    run.rows("paper").write_bytes(b"".join(map(to_line, rows)))
    unseal(run.path)


def expect_unharmed(page: Page, before: int) -> None:
    page.wait_for_timeout(300)
    assert page.evaluate("window.owned") is None
    assert page.locator(OWN_TAGS).count() == before
    size = page.viewport_size
    assert size is not None
    assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]


@pytest.mark.parametrize("evil", EVIL, ids=NAMES)
def test_hostile_text_stays_text(small_run: Path, tmp_path: Path, open_page: OpenPage, evil: str) -> None:
    """Programs, models, instructions, errors, checks, worlds, rooms, tasks, runs and files have the text."""
    name = "".join(c for c in evil if c.isprintable()).replace("/", "|")[:80].strip()
    whole = evil.encode(errors="replace").decode()  # An address cannot hold lone surrogates.
    run = RunFolder(tmp_path / "runs" / name)
    shutil.copytree(small_run, run.path)

    def make_evil(completion: dict[str, Any], row: dict[str, Any]) -> None:
        completion |= {"program": evil * 3, "model": evil, "instruction": evil}
        if completion["task"] == "LunchBreak":
            completion["task"] = row["task"] = f"{whole[:200]} LunchBreak"
        for verdict in row["verdicts"]:
            verdict["world"] = evil
            verdict["trace"] = [
                ["goto", evil],
                ["say", evil],
                ["check", evil, True],
                ["ask", evil, [evil], evil],
            ]
            verdict["failed_checks"] = [evil] * len(verdict["failed_checks"])
            if verdict["error"]:
                verdict["error"] = {"kind": evil, "message": evil}
        if row["failure"]:
            check = row["failure"]["check"] and evil
            row["failure"] |= {"class": whole[:300], "kind": whole[:300], "check": check}

    rewrite_run(run, make_evil)
    shutil.copy(run.rows("paper"), run.rows(name))
    shutil.copy(run.manifest("paper"), run.manifest(name))
    with serve_runs(run.path.parent) as server:
        for size in (DESK, PHONE) if len(evil) > LONGEST else (PHONE,):
            page = open_page(server, size=size)
            expect(page.locator(".runs tbody tr")).to_have_count(1)
            count = page.locator(OWN_TAGS).count()
            expect_unharmed(page, count)
            page.locator(".runs tbody a").click()
            expect(page.locator("#count")).to_have_text("15 completions")
            expect_unharmed(page, count)
            page.locator(".kind").nth(2).click()
            expect(page.get_by_role("button", name="Show all")).to_be_visible()
            expect_unharmed(page, count)
            page.locator(".completions-view a").first.click()
            expect(page.locator(".world-of").first).to_be_visible()
            page.locator("summary", has_text="All steps").first.click()
            expect(page.locator(".unfolded pre")).to_be_visible()
            shown = page.locator(".program").inner_text()
            assert "".join(shown.split())[1:8] == "".join(escape_invisible(evil).split())[:7]
            expect_unharmed(page, count)
            page.goto(f"{server.inside}/runs")
            page.get_by_role("checkbox").check()
            page.get_by_role("button", name="Show side by side").click()
            expect(page.locator(".heat td").first).to_be_visible()
            expect_unharmed(page, count)
            page.context.close()


def escape_invisible(text: str) -> str:
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def test_nothing_runs_in_a_report_that_comes_with_a_run(
    real_server: PageServer, real_runs: Path, open_page: OpenPage
) -> None:
    report = real_runs / "hasty" / "report"
    page = open_page(real_server, expecting="Blocked script execution")
    page.goto(f"{real_server.inside}/runs/hasty")
    expect(page.locator(".completions-view a").first).to_be_visible()
    assert page.get_by_text("Report of this run").count() == 0
    report.mkdir()
    html = "<p style='color: red'>all is well</p><img src='data:,' onerror='owned=1'><script>owned=1</script>"
    (report / "index.html").write_text(html)
    page.reload()
    page.get_by_text("Report of this run").click()
    expect(page.get_by_text("all is well")).to_be_visible()
    page.wait_for_timeout(300)
    assert page.evaluate("typeof owned") == "undefined"
    shutil.rmtree(report)


def test_three_runs_are_compared_pair_by_pair(small_run: Path, tmp_path: Path, open_page: OpenPage) -> None:
    folder = tmp_path / "runs"
    for name in ("a", "b"):
        shutil.copytree(small_run, folder / name)
    make_run(folder, "careful", "--tasks", "SayGoodDay", count=1)
    with serve_runs(folder) as server:
        page = open_page(server)
        page.goto(f"{server.inside}/side-by-side?run=a&run=b&run=careful")
        expect(page.locator(".pairs li")).to_have_count(3)
        expect(page.locator(".heat td", has_text="no completions")).to_have_count(2)
        page.locator(".pairs a").nth(1).click()
        rows = page.locator(".differences tbody tr")
        expect(rows.locator("th")).to_have_text(["All tasks", "SayGoodDay"])
        expect(page.locator(".differences thead")).to_contain_text("careful \N{MINUS SIGN} a")
        page.context.close()


# --- layout


@pytest.mark.parametrize("size", [(1366, 900), PHONE])
def test_layout_shows_everything(real_server: PageServer, open_page: OpenPage, size: tuple[int, int]) -> None:
    page = open_page(real_server, size=size)
    expect(page.locator(".bar .pages")).to_be_visible(visible=size != PHONE)
    page.goto(f"{real_server.inside}/runs/hasty")
    expect(page.locator(".kind", has_text="failed checks")).to_be_visible()
    assert page.locator(".ends").evaluate("e => e.scrollHeight <= e.clientHeight")
    page.goto(f"{real_server.inside}/side-by-side?run=careful&run=hasty")
    expect(page.locator(".differences tbody tr").first).to_be_visible()
    heights = page.locator(".differences tbody tr").evaluate_all("rows => rows.map(row => row.clientHeight)")
    assert max(heights) < 60
    lines = page.locator(".heat thead th span").evaluate_all(
        "heads => heads.map(e => [e.textContent, e.getClientRects().length])"
    )
    assert all(count <= len(text.split()) for text, count in lines)


@pytest.mark.parametrize("screen", SCREENS, ids=lambda screen: screen[0])
def test_pages(real_server: PageServer, open_page: OpenPage, shoot: Shoot, screen: Screen) -> None:
    which, size, dark = screen
    page = open_page(real_server, size=size, dark=dark)

    def look(name: str) -> None:
        page.evaluate("scrollTo(0, 0)")
        page.wait_for_timeout(300)
        shoot(page, f"{name}-{which}")
        expect_no_grave_fault(page)
        assert page.evaluate("document.documentElement.scrollWidth") <= size[0]

    expect(page.locator(".runs tbody tr")).to_have_count(2)
    look("runs")
    assert page.locator(".sideways").first.evaluate("e => e.scrollWidth <= e.clientWidth")
    for box in page.get_by_role("checkbox").all():
        box.check()
    page.get_by_role("button", name="Show side by side").click()
    expect(page.locator(".heat").nth(1).locator("td").first).to_be_visible()
    expect(page.locator(".differences tbody tr").first).to_be_visible()
    look("side-by-side")
    page.locator(".beside-list a", has_text="hasty").click()
    expect(page.locator(".completions-view a").first).to_be_visible()
    look("run")
    page.locator(".kind", has_text="SayAtLocation").click()
    expect(page.locator("#count")).to_have_text("18 completions")
    look("run-filtered")
    page.locator(".completions-view a").first.click()
    expect(page.locator(".failed-check").first).to_be_visible()
    page.locator("summary", has_text="All steps").first.click()
    page.locator("summary", has_text="The world").first.click()
    expect(page.locator(".unfolded .floorplan")).to_be_visible()
    look("completion")
