"""What errors say to people, collected while the tests run, so that a reader sees every message once."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from itertools import groupby
from pathlib import Path
from typing import Any

ERRORS = {
    "UserError": "codebotler.core.errors",
    "EngineError": "codebotler.simulator.process.errors",
    "MissionError": "codebotler.missions.mission",
    "ModelError": "codebotler.models.base",
    "NotReadyError": "codebotler.robots.base",
    "RefusedError": "codebotler.web.security.guard",
    "RobotError": "codebotler.simulator.worlds.robot",
    "RobotLostError": "codebotler.robots.base",
    "RtlSyntaxError": "codebotler.rtl.source",
}
"""Those whose text a user reads, and where they are defined."""
SOURCES = Path(import_module("codebotler").__path__[0]).parent
Said = dict[str, str]
"""Sentences, by the place that raises them, such as `codebotler/core/world.py:12`."""


def collect(said: Said) -> None:
    """Note the first sentence of each place from now on."""
    for name, module in ERRORS.items():
        kind = getattr(import_module(module), name)
        kind.__init__ = _noting(kind.__init__, said)


def _noting(plain: Callable[..., None], said: Said) -> Callable[..., None]:
    def noting(error: Exception, *given: Any, **named: Any) -> None:  # noqa: ANN401 - whatever an error takes
        plain(error, *given, **named)
        frame = sys._getframe(1)
        path = Path(frame.f_code.co_filename)
        if path.is_relative_to(SOURCES):
            said.setdefault(f"{path.relative_to(SOURCES)}:{frame.f_lineno}", str(error))

    return noting


def written(said: Mapping[str, str]) -> str:
    """All sentences, module by module, and at the end the places that no test has reached."""
    places = sorted(said, key=lambda place: (place.partition(":")[0], int(place.partition(":")[2])))
    parts = ["# What errors say\n"]
    for module, group in groupby(places, key=lambda place: place.partition(":")[0]):
        parts.append(f"\n## {module}\n\n")
        parts.extend(f"- {place.partition(':')[2]}: {said[place]}\n" for place in group)
    parts.append("\n## Raised where no test has been\n\n")
    parts.extend(f"- {place}\n" for place in raised() if place not in said)
    return "".join(parts)


def raised() -> list[str]:
    """The places in the sources at which one of the errors is made."""
    return [
        f"{path.relative_to(SOURCES)}:{node.lineno}"
        for name in ("codebotler", "roboeval")
        for path in sorted((SOURCES / name).rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ERRORS
    ]
