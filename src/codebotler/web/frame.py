"""The frame of all pages: the bar with STOP, plain text and buttons, and an entry point for more pages."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import entry_points
from inspect import iscoroutine
from pathlib import Path
from typing import Any, Generic, TypeVar

from fastapi import FastAPI
from nicegui import html, ui
from nicegui.element import Element
from nicegui.elements.mixins.text_element import TextElement
from nicegui.events import GenericEventArguments

from codebotler.core.errors import UserError
from codebotler.core.terminal import note, visible_lines
from codebotler.missions.mission import MissionError
from codebotler.robots.base import AnswerError
from codebotler.web.security.proxy import prefix_of

_STYLESHEET_HTML = '<link rel="stylesheet" href="{prefix}/static/page.css">'
_STOP_BAR_HTML = """<div id="stop-bar"><span id="stop-told" role="status" aria-live="assertive"></span>
<button id="stop" type="button" aria-keyshortcuts="Escape"><b>STOP</b><small>Esc</small></button></div>
<script src="{prefix}/static/stop.js"></script>"""
ROBOT_LINKS = (("Robot", "/"), ("Missions", "/missions"))
FACE_LINK = ("Face", "/face")
_ENTRY_POINTS = "codebotler.pages"
"""The entry point group for pages of other packages."""

PAGE_BUILD_SECONDS = 60.0
"""The time limit for building a page, which may first have to read a run."""


@dataclass(frozen=True)
class Frame:
    """Adds the bar and STOP to a page. STOP works even if the rest of the page does not.

    Args:
        links: the names and addresses of pages, in order.
        brand: the name shown in the bar.
        has_robot: whether to show STOP.
    """

    links: tuple[tuple[str, str], ...] = ROBOT_LINKS
    brand: str = "CodeBotler"
    has_robot: bool = True

    def __call__(self, title: str, here: str, parts: Sequence[tuple[str, str]] = ()) -> None:
        """Begin a page. Its bar highlights the address `here`. On small screens, the bar links to `parts`."""
        ui.page_title(f"{title} · {self.brand}")
        ui.add_head_html(_STYLESHEET_HTML.format(prefix=outside("")))
        if self.has_robot:
            ui.add_body_html(_STOP_BAR_HTML.format(prefix=outside("")))
        with ui.element("header").classes("bar" if self.has_robot else "bar no-stop"):
            html.a(self.brand, href=outside("/")).classes("brand")
            if parts:
                with ui.element("nav").classes("parts").props('aria-label="Parts of this page"'):
                    for name, address in parts:
                        html.a(name, href=address)
            with ui.element("nav").classes("pages").props('aria-label="Pages"'):
                for name, address in self.links:
                    link = html.a(name, href=outside(address))
                    if address == here:
                        link.props('aria-current="page"')


def outside(address: str) -> str:
    """Add the prefix that browsers must use to a path: return `/robot/missions` for `/missions`."""
    request = ui.context.client.request
    return prefix_of(request.scope) + address


def script(name: str) -> None:
    """Add one of our scripts to the page, given its file name."""
    ui.add_head_html(f'<script src="{outside("/static")}/{name}"></script>')


# --- texts are never interpreted as markup, and hidden characters are escaped


class PlainText(TextElement):
    """An HTML element with plain text. `kind` contains its CSS classes."""

    def __init__(self, tag: str, text: str = "", kind: str = "") -> None:
        super().__init__(tag=tag, text=visible_lines(text))
        self.classes(kind)
        self.props("dir=auto")

    def show_text(self, text: str) -> None:
        """Replace the text, or hide the element if the text is empty."""
        shown = visible_lines(text)
        if shown != self.text:
            self.text = shown
        self.set_visibility(bool(text))


def scroll_up() -> None:
    """Scroll to the top of the page, where the next step is."""
    ui.run_javascript("scrollTo(0, 0)")


def scroll_to(element: str) -> None:
    """Scroll to the element with the given ID."""
    ui.run_javascript(f"document.getElementById({element!r}).scrollIntoView()")


def warn(sentence: str, seconds: float = 5.0) -> None:
    """Show a warning on the page for the given number of seconds."""
    ui.notify(visible_lines(sentence), type="warning", position="bottom", timeout=1000 * seconds)


@contextmanager
def warned() -> Iterator[None]:
    """Show a UserError, MissionError or AnswerError of the `with` block as a warning on the page."""
    try:
        yield
    except (AnswerError, MissionError, UserError) as error:
        warn(error.sentence)


class Button(PlainText):
    """A button that calls `pressed` and shows its errors. `emits` is JavaScript for an argument, if any."""

    def __init__(self, text: str, pressed: Callable[..., Any], kind: str = "", *, emits: str = "") -> None:
        async def press(event: GenericEventArguments) -> None:
            with warned():
                result = pressed(event.args) if emits else pressed()
                if iscoroutine(result):  # a dialog could be awaited, too, and would open again
                    await result

        super().__init__("button", text, kind)
        self.props("type=button")
        self.on("click", press, js_handler=f"() => emit({emits})")

    def allow(self, may: bool) -> None:  # noqa: FBT001 - the only argument
        """Enable or disable the button."""
        if may:
            self.props(remove="disabled")
        else:
            self.props("disabled")


Content = TypeVar("Content")


class DrawnBox(Element, Generic[Content]):
    """An element that draws its content with `draw`, but only when the content has changed."""

    def __init__(self, kind: str, draw: Callable[[Content], None], tag: str = "div") -> None:
        super().__init__(tag)
        self.classes(kind)
        self.set_visibility(False)
        self._draw = draw
        self.content: Content | None = None

    def show(self, content: Content | None) -> None:
        """Draw the content if it has changed. Hide the element if the content is None."""
        self.set_visibility(content is not None)
        is_same, self.content = content == self.content, content
        if not is_same:
            self.clear()
            if content is not None:
                with self:
                    self._draw(content)


# --- pages of other packages


@dataclass(frozen=True)
class Site:
    """The website to which other packages add pages. Only operators can open them.

    Args:
        app: the application; API routes belong below `/api/`, and files below `/static/`.
        frame: the frame, which must be called first on each page.
        runs: the folder with the runs of benchmarks.
    """

    app: FastAPI
    frame: Frame
    runs: Path


@dataclass(frozen=True)
class Pages:
    """The pages that another package adds to a site.

    Args:
        name: the name shown in the bar.
        brand: the name of the site if it has no other pages.
        address: the address of the first page.
        add: a function that adds the pages to a site.
    """

    name: str
    brand: str
    address: str
    add: Callable[[Site], None]


def installed_pages() -> tuple[Pages, ...]:
    """Load the pages of installed packages. Skip those that fail to load, and report them on stderr."""
    found: list[Pages] = []
    for point in sorted(entry_points(group=_ENTRY_POINTS), key=lambda point: point.name):
        try:
            pages = point.load()
            if not isinstance(pages, Pages):
                raise TypeError(f"{point.value} is not an instance of Pages")  # noqa: TRY301 - reported below
        except Exception as error:  # noqa: BLE001 - no package may keep operators from the robot
            note(f'the pages "{point.name}" cannot be added: {error}')
        else:
            found.append(pages)
    return tuple(found)
