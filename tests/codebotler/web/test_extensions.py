"""Packages add pages by an entry point; a broken package does not keep people from the robot."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from pageserver import PageServer

GOOD = """from codebotler.web.frame import Pages
from codebotler.web.frame import PlainText
from nicegui import ui

def add(site):
    @ui.page("/hello")
    def hello():
        site.frame("Hello", "/hello")
        PlainText("h1", str(site.runs))
    site.app.get("/api/hello")(lambda: "hello")

PAGES = Pages("Hello", "Hello", "/hello", add)
"""


def install(folder: Path, name: str, source: str) -> None:
    """Put a package with an entry point into a folder, as an installer does."""
    (folder / f"{name}.py").write_text(source)
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[codebotler.pages]\n{name} = {name}:PAGES\n")


def test_a_package_adds_pages_and_a_broken_one_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packages = tmp_path / "packages"
    packages.mkdir()
    install(packages, "hello_pages", GOOD)
    install(packages, "broken_pages", "import nothing_of_this_name")
    install(packages, "wrong_pages", "PAGES = 1")
    monkeypatch.setenv("PYTHONPATH", f"{packages}:{os.environ.get('PYTHONPATH', '')}")
    with PageServer(tmp_path, "--runs", "my-runs") as server:
        page = server.call("GET", "/hello")
        assert (page.status, "my-runs" in page.text, "stop.js" in page.text) == (200, True, True)
        assert server.call("GET", "/api/hello").data == "hello"
        assert server.ask("GET", "/hello").status == server.ask("GET", "/api/hello").status == 401
        assert "Hello" in server.call("GET", "/").text
    assert re.search('"broken_pages" .*: No module named', server.output)
    assert '"wrong_pages"' in server.output


@pytest.mark.slow
def test_codebotler_needs_no_benchmark() -> None:
    """The pages of the benchmark come only through the entry point."""
    code = "import codebotler.web.server, sys; print(any(m.startswith('roboeval') for m in sys.modules))"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout == "False\n"
