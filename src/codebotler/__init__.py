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
    from codebotler.library import generate
    from codebotler.models.base import ModelError
    from codebotler.prompts import prompt_for
    from codebotler.reply import program_of
    from codebotler.simulator.lane import EngineError
else:  # a name is imported when it is first used: who needs the version need not wait for an engine
    HOMES = {
        "BadInput": "badinput",
        "Check": "checker",
        "EngineError": "simulator.lane",
        "Generation": "generation",
        "ModelError": "models.base",
        "Problem": "checker",
        "check": "checker",
        "generate": "library",
        "program_of": "reply",
        "prompt_for": "prompts",
    }

    def __getattr__(name: str) -> object:
        if name not in HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}", name=name)
        from importlib import import_module  # noqa: PLC0415 - only where something is used

        globals()[name] = value = getattr(import_module(f"{__name__}.{HOMES[name]}"), name)
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})
