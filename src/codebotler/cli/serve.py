"""`codebotler serve`: puts the robot, the models and the rules together, and serves the page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from codebotler.cli.run import tell_missing
from codebotler.core.files import home
from codebotler.models.base import Model, SamplingSettings
from codebotler.models.chosen import chosen_model
from codebotler.models.open import expect_server, kind_of, open_model, runs_on_server
from codebotler.robots.base import Options
from codebotler.robots.face import Face
from codebotler.robots.open import open_robot, open_with_face
from codebotler.simulator.rule_guard import Rule
from codebotler.web.access import Access, Place
from codebotler.web.console import Console


def serve(
    robot: str,
    settings: Options,
    models: tuple[str, ...],
    open_model: Callable[[str], Model],
    place: Place,
    access: Access,
    runs: Path,
    *,
    face: Face | None,
    rules: tuple[Rule, ...],
    alone_for: float | None,
) -> None:
    """Serve the page for a robot until Ctrl-C."""
    body = open_robot(robot, settings) if face is None else open_with_face(robot, settings, face)
    tell_missing(body)
    world = settings.world
    console = Console(body, home(), open_model, models=models, world=world, face=face, rules=rules)

    from codebotler.web import server
    from codebotler.web.frame import installed_pages

    server.serve(console, place, access, installed_pages(), runs, alone_for=alone_for)


def opener(models: Sequence[str], base_url: str | None) -> Callable[[str], Model]:
    """What opens models by their names; names that make no sense are refused at once."""
    for each in models:
        kind_of(each)
    if base_url is not None:
        expect_server(*models)
    return lambda name: open_model(
        name,
        SamplingSettings(base_url=chosen_model(name, base_url).base_url if runs_on_server(name) else None),
    )
