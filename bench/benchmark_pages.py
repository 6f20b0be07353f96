"""Measures how long it takes to open a run of 4,000 completions in a browser, and to scroll through it.

The run is synthetic: it repeats the verdicts on the programs that ship with the package. `roboeval serve`
shows it in the system's Chromium. All pages are opened once before the measurements. The script then opens
each page OPENS=10 times, and prints the largest and the median time in milliseconds until the page is
complete: a run with its heat map and first completions, the list of all runs, a filter, and one completion.
It also prints how long completions take to appear after a jump to another position, and the duration of the
first opening, which reads the files.
"""

import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from statistics import median

from playwright.sync_api import Page, sync_playwright

from report import make_run
from roboeval.suites.load import load_suite

OPENS = int(os.environ.get("OPENS", "10"))
AIM, AIM_OF_A_JUMP = 1_000.0, 100.0
FRAMES = """async () => {
  const view = document.querySelector(".completions-view");
  let worst = 0, last = performance.now(), empty = 0, frames = 0;
  while (view.scrollTop + view.clientHeight < view.scrollHeight - 1 && frames < 240) {
    view.scrollTop += 180;
    await new Promise(requestAnimationFrame);
    const now = performance.now();
    worst = Math.max(worst, now - last);
    last = now;
    frames++;
    const [top, bottom] = [view.getBoundingClientRect().top, view.getBoundingClientRect().bottom];
    empty += [...view.querySelectorAll("[role=row]")].some((row) => {
      const place = row.getBoundingClientRect();
      return place.bottom > top && place.top < bottom && !row.querySelector("a");
    });
  }
  return [worst, empty, frames];
}"""
JUMP = """async (share) => {
  const view = document.querySelector(".completions-view");
  const began = performance.now();
  view.scrollTop = share * (view.scrollHeight - view.clientHeight);
  const wanted = Math.floor(view.scrollTop / 44) + 2;
  for (;;) {
    const row = view.querySelector(`[aria-rowindex="${wanted}"] a`);
    if (row) return performance.now() - began;
    await new Promise(requestAnimationFrame);
  }
}"""


def measure(do: Callable[[], object]) -> float:
    """Measure the duration of a call in milliseconds."""
    began = time.perf_counter()
    do()
    return 1000 * (time.perf_counter() - began)


def time_opening(page: Page, address: str, *there: str) -> float:
    """Open a page, and return the milliseconds until it is complete."""

    def open_it() -> None:
        page.goto(address)
        for one in there:
            page.locator(one).first.wait_for()

    return measure(open_it)


def time_filter(page: Page) -> float:
    """Filter by a kind of failure, then show all again. Return how many milliseconds the filter takes."""

    def choose() -> None:
        page.locator(".kind", has_text="SayAtLocation").click()
        page.locator("h2", has_text="that failed with SayAtLocation").wait_for()
        page.locator(".completions-view .completion", has_text="SayAtLocation").first.wait_for()

    took = measure(choose)
    page.locator("button", has_text="Show all").click()
    page.locator("h2", has_text=re.compile("^Completions$")).wait_for()
    page.locator("#count", has_text="4,000").wait_for()
    return took


def main() -> int:
    """Print all measurements. Return 1 if a target is missed."""
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = Path(name)
        run = make_run(folder, 0, load_suite())
        size = sum(path.stat().st_size for path in run.path.rglob("*") if path.is_file())
        command = [sys.executable, "-m", "roboeval", "serve", str(folder), "--port", "0"]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as tool, ExitStack() as stack:
            stack.callback(tool.terminate)
            assert tool.stderr is not None
            link = next(line.strip() for line in tool.stderr if "token=" in line)
            browser = playwright.chromium.launch(
                executable_path=shutil.which("chromium") or shutil.which("chromium-headless-shell"),
                args=["--no-sandbox", "--disable-gpu"],
            )
            page = browser.new_page(viewport={"width": 1440, "height": 900})
            page.goto(link)
            base = link.partition("?")[0]
            whole = (f"{base}runs/{run.path.name}", ".heat td a", ".completions-view a")
            one = (f"{base}runs/{run.path.name}/LunchBreak/0/7", ".program .line", ".world-of")
            first = time_opening(page, *whole)
            time_opening(page, *one)
            found = {"all runs": [time_opening(page, f"{base}runs", ".runs tbody a") for _ in range(OPENS)]}
            found["one completion"] = [time_opening(page, *one) for _ in range(OPENS)]
            found["one run"] = [time_opening(page, *whole) for _ in range(OPENS)]
            page.locator("#count", has_text="4,000").wait_for()
            found["a filter"] = [time_filter(page) for _ in range(OPENS)]
            places = random.Random(0)
            found["a jump"] = [page.evaluate(JUMP, places.random()) for _ in range(OPENS)]
            page.evaluate(JUMP, 0.0)
            worst, empty, frames = page.evaluate(FRAMES)
            browser.close()
    print(f"a run of 4,000 completions, {size / 1e6:.0f} MB: the first opening took {first:.0f} ms")
    aim = f"median targets: {AIM:.0f} for a page, {AIM_OF_A_JUMP:.0f} for a jump"
    print(f"worst of {OPENS} in ms ({aim})")
    for what, each in found.items():
        print(f"{what:15} {max(each):7.1f} (median {median(each):.1f})")
    print(
        f"scrolling: {frames} frames, the longest {worst:.0f} ms, {empty} with a row that was not loaded yet"
    )
    aims = {what: AIM_OF_A_JUMP if what == "a jump" else AIM for what in found}
    missed = [what for what, each in found.items() if median(each) > aims[what]]
    print(f"targets MISSED: {', '.join(missed)}" if missed else "all targets met")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
