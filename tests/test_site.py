"""The documentation as a site: every page is in it, and no page loads anything from elsewhere."""

import re
import runpy
from pathlib import Path
from typing import Any, TypeAlias

import pytest
import yaml

from codebotler.cli.app import app as codebotler
from roboeval.cli.app import app as roboeval

ROOT = Path(__file__).parent.parent
GENERATED_PAGES = {
    "changes.md",
    "codebotler.md",
    "examples.md",
    "python-codebotler.md",
    "python-roboeval.md",
    "roboeval.md",
}


@pytest.fixture(scope="module")
def build() -> dict[str, Any]:
    return runpy.run_path(str(ROOT / "website" / "build.py"))


Nav: TypeAlias = "str | list[Nav] | dict[str, Nav]"


def pages(nav: Nav) -> list[str]:
    if isinstance(nav, str):
        return [nav]
    return [page for entry in (nav.values() if isinstance(nav, dict) else nav) for page in pages(entry)]


def test_every_page_is_in_the_navigation_once() -> None:
    nav = pages(yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"])
    written = [path.name for path in (ROOT / "docs").glob("*.md")]
    assert sorted(nav) == sorted([*GENERATED_PAGES, *written, "decisions/index.md"])


def test_every_decision_is_in_the_index_newest_first_and_its_links_lead_somewhere() -> None:
    folder = ROOT / "docs" / "decisions"
    rows = re.findall(r"^\| (\d+) \| \[(.+)\]\((.+)\) \|", (folder / "index.md").read_text(), re.MULTILINE)
    names = sorted((path.name for path in folder.glob("[0-9]*.md")), reverse=True)
    assert [name for _, _, name in rows] == names
    for number, title, name in rows:
        text = (folder / name).read_text()
        assert name.startswith(f"{int(number):02}-")
        assert text.startswith(f"# {title}\n\n**Decision.** ")
        assert "\n\n**Why.** " in text
        for target in re.findall(r"\]\((?!https?:)([^)#]+)", text):
            assert (folder / target).exists(), (name, target)


def test_page_of_a_command_shows_its_help(build: dict[str, Any]) -> None:
    for name, app in (("codebotler", codebotler), ("roboeval", roboeval)):
        page = build["_commands"](name, app)
        for command in app.registered_commands:
            verb = command.name or getattr(command.callback, "__name__", "").replace("_", "-")
            assert f"\n## {name} {verb}\n\n```text\nUsage: {name} {verb} [OPTIONS]" in page


def test_links_to_examples_stay_within_the_site(build: dict[str, Any]) -> None:
    assert build["_within"]("[x](../examples/rtl.py)") == "[x](examples.md#rtl-py)"
    assert "## rtl.py {#rtl-py}" in build["_examples"]()


@pytest.mark.parametrize(
    ("page", "load"),
    [
        ('<script src="https://a.b/c.js"></script>', "script https://a.b/c.js"),
        ('<link rel="stylesheet" href=//a.b/c.css>', "link //a.b/c.css"),
        ('<p><img alt="" src="http://a.b/c.png"/>', "img http://a.b/c.png"),
        ("<link rel=preconnect href='https://a.b' crossorigin>", "link https://a.b"),
        ('<img src=c.png srcset="d.png 1x, https://a.b/c.png 2x">', "img https://a.b/c.png 2x"),
        ('<object data="HTTPS://a.b/c"></object>', "object HTTPS://a.b/c"),
        ('<p style="background: URL( https://a.b/c.png )">', "p https://a.b/c.png"),
        ("<style>p { color: red } @import url(https://a.b/c.css);</style>", "style https://a.b/c.css"),
        ("<svg><image href='https://a.b/c.png'/></svg>", "image https://a.b/c.png"),
        ("<svg><use xlink:href='https://a.b/c.svg#d'/></svg>", "use https://a.b/c.svg#d"),
        ("<iframe srcdoc='<img src=https://a.b/c>'></iframe>", "img https://a.b/c"),
        ("<video poster=' //a.b/c.png'></video>", "video //a.b/c.png"),
        ("<base href='https://a.b/'>", "base https://a.b/"),
    ],
)
def test_loads_of_pages_from_elsewhere_are_found(
    build: dict[str, Any], tmp_path: Path, page: str, load: str
) -> None:
    (tmp_path / "good.html").write_text(
        '<a href="https://a.b">x</a><img src="c.png" srcset="d.png 2x"><p style="background: url(d.png)">'
        '<link rel=canonical href="https://a.b/good.html"><code>@import url(https://a.b)</code>'
    )
    assert [*build["outside_loads"](tmp_path)] == []
    (tmp_path / "bad.html").write_text(page)
    assert [*build["outside_loads"](tmp_path)] == [f"bad.html: {load}"]


@pytest.mark.parametrize(
    "sheet",
    [
        *("@import 'https://a.b/c.css';", "@import url(https://a.b/c.css);", "@import/**/'//a.b/c.css';"),
        *("a { background: url(//a.b/c.png) }", 'a { background: image-set("https://a.b/c.png" 1x) }'),
    ],
)
def test_loads_of_style_sheets_are_found(build: dict[str, Any], tmp_path: Path, sheet: str) -> None:
    (tmp_path / "good.css").write_text("a { background: url(data:image/png;base64,AA) }")
    assert [*build["outside_loads"](tmp_path)] == []
    (tmp_path / "bad.css").write_text(sheet)
    assert len([*build["outside_loads"](tmp_path)]) == 1


def test_loads_of_drawings_are_found(build: dict[str, Any], tmp_path: Path) -> None:
    drawing = '<svg xmlns="http://www.w3.org/2000/svg"><image href="//a.b/c.png"/></svg>'
    (tmp_path / "bad.svg").write_text(drawing)
    assert [*build["outside_loads"](tmp_path)] == ["bad.svg: image //a.b/c.png"]


def test_the_site_is_searched_from_a_folder() -> None:
    """Our own worker searches; without it, the builder would load one from a server."""
    configured = yaml.safe_load((ROOT / "mkdocs.yml").read_text())
    assert "offline" in configured["plugins"]
    (worker,) = configured["extra"]["polyfills"]
    assert worker == "iframe-worker.js"
    assert (ROOT / "website" / worker).exists()
