"""Builds the documentation as a site in build/site: `make docs`.

Pages come from docs/, the changelog, the examples, the docstrings and `--help`. A warning is an error, and
so is a page that would load anything from elsewhere.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import typer

import codebotler.cli.app
import roboeval.cli.app

ROOT = Path(__file__).parent.parent
PAGES, SITE = ROOT / "build" / "pages", ROOT / "build" / "site"

WIDTH = 82  # Letters in a line of `--help` on the site.

MODULES = {
    "codebotler": (
        *("codebotler", "codebotler.simulator", "codebotler.core.program", "codebotler.core.world"),
        "codebotler.core.world_file",
        *("codebotler.core.skills.paper", "codebotler.core.skills.table"),
        *("codebotler.core.trace", "codebotler.rtl"),
        *("codebotler.rtl.reasoning", "codebotler.missions.mission"),
        *("codebotler.robots.base", "codebotler.robots.simulated", "codebotler.robots.reservation"),
        *("codebotler.robots.ros.robot", "codebotler.robots.ros.kinds", "codebotler.robots.ros.virtual"),
        *("codebotler.robots.ros.worker", "codebotler.models.base", "codebotler.models.open"),
        *("codebotler.models.rate_limit", "codebotler.perception", "codebotler.web.frame"),
    ),
    "roboeval": (
        "roboeval",
        "roboeval.suites.load",
        "roboeval.suites.suite",
        "roboeval.evaluation.runs.completions",
        "roboeval.evaluation.runs.traces",
        "roboeval.analysis.metrics",
        "roboeval.suites.families.tasks",
        "roboeval.training.prompts",
        "roboeval.training.missions",
        "roboeval.training.rollouts",
    ),
}
"""The packages, whose names are public, and their documented modules; see docs/library.md."""


def main() -> None:
    """Collect the pages, build the site, and fail if it would load anything from elsewhere."""
    shutil.rmtree(ROOT / "build" / "pages", ignore_errors=True)
    shutil.rmtree(SITE, ignore_errors=True)
    shutil.copytree(ROOT / "docs", PAGES)
    for name in ("site.css", "iframe-worker.js"):
        shutil.copy(ROOT / "website" / name, PAGES)
    for path in PAGES.rglob("*.md"):
        path.write_text(_within(path.read_text()))
    (PAGES / "changes.md").write_text((ROOT / "CHANGELOG.md").read_text())
    (PAGES / "examples.md").write_text(_examples())
    for name, app in (("codebotler", codebotler.cli.app.app), ("roboeval", roboeval.cli.app.app)):
        (PAGES / f"{name}.md").write_text(_commands(name, app))
        (PAGES / f"python-{name}.md").write_text(_python(name))
    command = [sys.executable, "-m", "zensical", "build", "--strict", "--clean"]
    ended = subprocess.run(
        command, cwd=ROOT, check=False, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    if ended.returncode != 0 or re.search(r"warning|^griffe:", ended.stdout, re.IGNORECASE | re.MULTILINE):
        sys.exit(f"{ended.stdout}\nthe site was not built, or has warnings; warnings count as errors")
    if loads := [*outside_loads(SITE)]:
        sys.exit("\n".join(["the site would load from elsewhere:", *loads]))
    print(f"{sum(1 for _ in SITE.rglob('*.html'))} pages are in {SITE}")


# --- pages


def _within(text: str) -> str:
    """Return a page with links that stay within the site."""
    text = re.sub(r"\]\(\.\./examples/([\w./]+\.\w+)\)", lambda m: f"](examples.md#{_anchor(m[1])})", text)
    text = re.sub(r"\]\(\.\./examples/\w+\)", "](examples.md)", text)
    return text.replace("](../CHANGELOG.md)", "](changes.md)")


def _anchor(name: str) -> str:
    return re.sub(r"\W", "-", name)


def _examples() -> str:
    parts = ["# Examples", "Small, complete, and run by the tests of the project."]
    folder = ROOT / "examples"
    globs = ("robots/*.py", "rules/*.yaml", "worlds/*.yaml", "skills/*.py", "skills/*/skills.py")
    further = [path for pattern in globs for path in sorted(folder.glob(pattern))]
    for path in [*sorted(one for one in folder.iterdir() if one.is_file()), *further]:
        language = {".py": "python", ".yaml": "yaml"}.get(path.suffix, "text")
        name = str(path.relative_to(folder))
        parts += [f"## {name} {{#{_anchor(name)}}}", f"````{language}\n{path.read_text()}````"]
    return "\n\n".join(parts) + "\n"


def _python(package: str) -> str:
    about = (
        f"The names that `{package}` itself gives are public and stay as they are. What its modules on this "
        "page give may change from one minor version to the next, with a line in the [changes](changes.md). "
        "All other modules are private. [From Python](library.md#public-names) lists both; "
        "[examples](examples.md) show them at work."
    )
    head = f"# {package} from Python\n\n{about}"
    return "\n\n".join([head, *(f"::: {module}" for module in MODULES[package])]) + "\n"


def _commands(name: str, app: typer.Typer) -> str:
    group: Any = typer.main.get_command(app)  # Of click or typer, depending on the version.
    parts = [f"# {name}", f"```text\n{_help(group, name)}\n```"]
    for verb, command in sorted(group.commands.items()):
        parts += [f"## {name} {verb}", f"```text\n{_help(command, f'{name} {verb}')}\n```"]
    return "\n\n".join(parts) + "\n"


def _help(command: Any, name: str) -> str:
    context = typer.Context(command, info_name=name, terminal_width=WIDTH, max_content_width=WIDTH)
    return str(command.get_help(context))


# --- loads from elsewhere


LOADS = {"src", "srcset", "imagesrcset", "poster", "data", "background", "xlink:href"}  # Of every element.
HREF_LOADS = {"link", "base", "image", "feimage", "use"}  # Elsewhere `href` is only a link.
LISTS = {"srcset", "imagesrcset"}
NO_LOAD = {"canonical", "next", "prev", "license"}  # Browsers load none of these links.
ELSEWHERE = re.compile(r"(?:https?:|ftp:|wss?:|[\\/]{2})", re.IGNORECASE)
SHEET_LOADS = re.compile(
    r"(?:@import|url\(|image-set\()\s*(?:url\(\s*)?[\"']?\s*((?:https?:|[\\/]{2})[^\"')\s]+)", re.IGNORECASE
)


def _of_sheet(text: str) -> list[str]:
    """Return the outside addresses that a style sheet, or a part of one, would load."""
    return [str(address) for address in SHEET_LOADS.findall(re.sub(r"/\*.*?\*/", " ", text, flags=re.DOTALL))]


class _Loads(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.in_style = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.in_style = tag == "style"
        is_no_load = tag == "link" and dict(attrs).get("rel") in NO_LOAD
        for name, value in attrs:
            loads = name in LOADS or (name == "href" and tag in HREF_LOADS and not is_no_load)
            addresses = (value or "").split(",") if name in LISTS else [value or ""]
            near = (address.strip() for address in addresses if loads)
            self.found += [f"{tag} {address}" for address in near if ELSEWHERE.match(address)]
            self.found += [f"{tag} {address}" for address in _of_sheet(value or "")]
            if name == "srcdoc":
                self.found += _of_page(value or "")

    def handle_endtag(self, tag: str) -> None:
        self.in_style = self.in_style and tag != "style"

    def handle_data(self, data: str) -> None:
        if self.in_style:
            self.found += [f"style {address}" for address in _of_sheet(data)]


def _of_page(text: str) -> list[str]:
    parser = _Loads()
    parser.feed(text)
    parser.close()
    return parser.found


def outside_loads(site: Path) -> Iterator[str]:
    """Yield each outside address that pages, drawings and style sheets of a site load; scripts are not read.

    Args:
        site: its folder.
    """
    readers = {".html": _of_page, ".svg": _of_page, ".css": _of_sheet}
    for path in sorted(site.rglob("*")):
        if path.suffix in readers:
            found = readers[path.suffix](path.read_text())
            yield from (f"{path.relative_to(site)}: {each}" for each in found)


if __name__ == "__main__":
    main()
