"""A stay in a room, drawn on a page."""

from __future__ import annotations

from collections.abc import Container

from nicegui import ui

from codebotler.web.elements import Words
from codebotler.web.strip import Scene

SPOKEN = frozenset({"say", "ask", "answer"})


def draw_scene(scene: Scene, wrong: Container[int] = frozenset()) -> None:
    """Draw a stay in a room.

    Args:
        scene: which.
        wrong: numbers of steps that are marked.
    """
    kind = "scene" if scene.deeds or not scene.is_found else "scene passing"
    with ui.element("li").classes(f"{kind} wrong" if scene.step in wrong else kind):
        Words("b", scene.room, "room")
        if not scene.is_found:
            Words("span", "there is no such room", "deed missing")
        for deed in scene.deeds:
            look = f"deed deed-{deed.kind}" if deed.kind in SPOKEN else "deed"
            Words("span", deed.text, f"{look} wrong" if deed.step in wrong else look)
