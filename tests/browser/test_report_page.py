"""The report in a real browser: tables sort, groups filter, and it is readable without scripts.

Without Chromium, these tests are skipped and say so.
"""

import base64
import hashlib
import re
import subprocess
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from made_up_runs import HOSTILE, new_run
from roboeval.report.page import PAGE_SCRIPT
from roboeval.report.writing import sections, write_report
from viewing import chromium

CLICKS = """
addEventListener("load", () => {
  const seen = [];
  addEventListener("error", (event) => seen.push("error: " + event.message));
  const table = document.querySelector("#table-overall table");
  const names = () => [...table.tBodies[0].rows].map((row) => row.cells[0].textContent.slice(0, 4)).join(",");
  const button = [...table.tHead.querySelectorAll("button")].find((one) => one.textContent === "pass@1");
  button.click();
  seen.push("down: " + names());
  button.click();
  seen.push("up: " + names() + " " + button.parentNode.getAttribute("aria-sort"));
  const prompts = document.querySelector("#table-prompts table");
  const last = prompts.tHead.rows[0].cells.length - 1;
  for (const way of ["down", "up"]) {
    prompts.tHead.querySelectorAll("button")[last].click();
    const cells = [...prompts.tBodies[0].rows].map((row) => row.cells[last].textContent);
    seen.push("missing " + way + ": " + cells);
  }
  const groups = [...document.querySelectorAll(".group")];
  const shown = () => groups.filter((one) => one.offsetParent !== null).length;
  const all = shown();
  const [model, , , search] = document.querySelectorAll(".filters select, .filters input");
  model.value = "strong";
  model.dispatchEvent(new Event("input"));
  const told = document.querySelector("output");
  seen.push("filtered: " + (shown() > 0 && shown() < all) + " " + told.textContent);
  search.value = "no such words";
  search.dispatchEvent(new Event("input"));
  seen.push("none: " + shown());
  dispatchEvent(new Event("beforeprint"));
  seen.push("open: " + document.querySelectorAll("details.sheet:not([open])").length);
  dispatchEvent(new Event("afterprint"));
  seen.push("closed: " + document.querySelectorAll("details.sheet[open]").length);
  seen.push("pictures: " + [...document.images].every((one) => one.naturalWidth > 100));
  seen.push("hacked: " + (window.hacked === undefined));
  seen.push("wide: " + (document.documentElement.scrollWidth <= innerWidth));
  document.title = seen.join(" | ");
});
"""


@pytest.fixture(scope="module", name="chromium")
def find_chromium() -> str:
    found = chromium()
    if found is None:
        pytest.skip("there is no Chromium here")
    return found


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    program = f"</pre><img src=x onerror='window.hacked=1'><script>window.hacked=1</script>{HOSTILE}"
    passes = {
        "strong": {"Visit": (9, 8), "CountMugs": (10, 3)},
        "weak": {"Visit": (0, 2), "CountMugs": (1, 0)},
        HOSTILE: {"Visit": (4, 5)},  # Other tasks are missing, so some cells are empty.
    }
    runs = [
        new_run(name, those, written=lambda _, index: {"program": program} if index > 6 else {})
        for name, those in passes.items()
    ]
    list(write_report("t", ["about it"], sections(runs, command="c"), folder))
    return folder / "index.html"


def render(chromium: str, page: Path, folder: Path, *options: str) -> str:
    """Return the page after its scripts have run."""
    ended = subprocess.run(
        [
            chromium,
            *("--headless=new", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=3000"),
            *(f"--user-data-dir={folder / 'profile'}", "--window-size=500,900", *options),
            *("--dump-dom", page.as_uri()),
        ],
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    return ended.stdout


def test_sorting_filtering_and_printing(chromium: str, page: Path, tmp_path: Path) -> None:
    text = page.read_text()
    digest = base64.b64encode(hashlib.sha256(CLICKS.encode()).digest()).decode()
    text = text.replace("script-src ", f"script-src 'sha256-{digest}' ", 1)
    clicked = tmp_path / "clicked.html"
    clicked.write_text(text.replace("</body>", f"<script>{CLICKS}</script></body>"))
    title = re.search(r"<title>(.*?)</title>", render(chromium, clicked, tmp_path), re.DOTALL)
    assert title is not None
    assert title[1].split(" | ") == [
        "down: stro,&lt;scr,weak",
        "up: weak,&lt;scr,stro ascending",
        "missing down: 0.500,0.400,-,-",
        "missing up: 0.400,0.500,-,-",
        "filtered: true 10 of 47 groups shown, 10 completions",
        "none: 0",
        "open: 0",
        "closed: 0",
        "pictures: true",
        "hacked: true",
        "wide: true",
    ]


A4 = 186 * 96 // 25  # pixels between margins of 12 mm


def test_nothing_is_cut_off_on_paper(browser: Browser, page: Path) -> None:
    render = browser.new_page(viewport={"width": A4, "height": 1000})
    render.goto(page.as_uri())
    render.emulate_media(media="print")
    render.evaluate("dispatchEvent(new Event('beforeprint'))")
    ends = render.evaluate(
        "[...document.querySelectorAll('table, img, pre')].map((one) => one.getBoundingClientRect())"
        ".filter((box) => box.width > 0).map((box) => box.right)"
    )
    render.close()
    assert len(ends) > 15
    assert max(ends) <= A4


def test_report_is_readable_without_scripts(chromium: str, page: Path, tmp_path: Path) -> None:
    quiet = tmp_path / "quiet.html"
    quiet.write_text(page.read_text().replace(PAGE_SCRIPT.read_text(), ""))
    text = render(chromium, quiet, tmp_path)
    assert "<button" not in text
    assert 'class="filters"' not in text
    assert text.count('<th scope="col"') > 20
    assert "pass@1 by task" in text


def test_no_other_script_runs(chromium: str, page: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.html"
    other.write_text(page.read_text().replace("</body>", "<script>document.title = 'ran'</script></body>"))
    assert "<title>ran</title>" not in render(chromium, other, tmp_path)
