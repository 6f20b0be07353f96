"""From an instruction in plain words to a checked robot program that can be stopped at any moment."""

from __future__ import annotations

__version__ = "0.1.0"

__all__ = [
    "BadInput",
    "Check",
    "EngineError",
    "Generation",
    "ModelError",
    "Problem",
    "__version__",
    "check",
    "generate",
    "program_of",
    "prompt_for",
]

TYPE_CHECKING = False
if TYPE_CHECKING:
    from codebotler.badinput import BadInput
    from codebotler.checker import Check, Problem, check
    from codebotler.generation import Generation
    from codebotler.models.base import ModelError
    from codebotler.onecall import generate
    from codebotler.prompts import prompt_for
    from codebotler.reply import program_of
    from codebotler.simulator.lane import EngineError
else:  # each name is imported when it is first used
    from codebotler.facade import facade

    __getattr__, __dir__ = facade(
        __name__,
        {
            "BadInput": "badinput",
            "Check": "checker",
            "EngineError": "simulator.lane",
            "Generation": "generation",
            "ModelError": "models.base",
            "Problem": "checker",
            "check": "checker",
            "generate": "onecall",
            "program_of": "reply",
            "prompt_for": "prompts",
        },
    )
