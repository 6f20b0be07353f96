"""Open the console of `codebotler run`, `continue`, `serve` and `mcp`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from codebotler.cli import options
from codebotler.cli.model_options import model_settings, options_for
from codebotler.core.files import home
from codebotler.core.terminal import note
from codebotler.core.text.words import listed
from codebotler.models.open import choose_model, make_opener
from codebotler.robots.face import Face
from codebotler.robots.open import open_robot, open_with_face
from codebotler.web.console import Console


def open_console(
    model: Sequence[str] | None,
    base_url: str | None,
    shared: Mapping[str, Any],
    *,
    candidates: int = 1,
    face: Face | None = None,
    recoveries: int = 0,
) -> Console:
    """Return a console with the robot and the models that the options name.

    Without `model`, the console has the default model and the recorded ones. `shared` holds the options of
    `robot_settings` and `model_settings` by name. The other arguments are those of `Console`.
    """
    kind, settings, rules, within = options.robot_settings(**options_for(options.robot_settings, shared))
    if kind == "sim" and shared["world"] is None:
        note("the robot works in an example office; --world FILE selects another world")
    models = tuple(model or dict.fromkeys((choose_model().name, "recorded:careful", "recorded:hasty")))
    opener = make_opener(models, base_url, model_settings(**options_for(model_settings, shared)))
    robot = open_robot(kind, settings) if face is None else open_with_face(kind, settings, face)
    if robot.missing:
        note(f"{robot.name} has no {listed([*robot.missing])}; models see only its other skills")
    return Console(
        robot,
        home(),
        opener,
        models=models,
        world=settings.world,
        face=face,
        rules=rules,
        within=within,
        candidates=candidates,
        recoveries=recoveries,
    )
