"""From an instruction in plain words to a checked robot program that can be stopped at any moment."""

from __future__ import annotations

__version__ = "0.1.0"

__all__ = [
    "CheckResult",
    "EngineError",
    "Generation",
    "ModelError",
    "PersonName",
    "Problem",
    "RobotError",
    "RoomName",
    "SamplingSettings",
    "Simulation",
    "ThingName",
    "UserError",
    "__version__",
    "check",
    "generate",
    "program_of",
    "prompt_for",
    "skill",
    "skills_from",
]

TYPE_CHECKING = False
if TYPE_CHECKING:
    from codebotler.checking.check import check
    from codebotler.checking.problems import CheckResult, Problem
    from codebotler.core.errors import RobotError, UserError
    from codebotler.core.skills.declaration import skill
    from codebotler.core.skills.files import skills_from
    from codebotler.core.skills.simulation import Simulation
    from codebotler.core.skills.values import PersonName, RoomName, ThingName
    from codebotler.generation.generate import Generation, generate
    from codebotler.models.base import ModelError
    from codebotler.models.sampling import SamplingSettings
    from codebotler.prompts import prompt_for
    from codebotler.prompts.extract import program_of
    from codebotler.simulator.worker import EngineError
else:  # each name is imported when it is first used
    from codebotler.core.facade import facade

    __getattr__, __dir__ = facade(
        __name__,
        {
            "checking.check": ["check"],
            "checking.problems": ["CheckResult", "Problem"],
            "core.errors": ["BadInput", "RobotError", "UserError"],
            "core.skills.declaration": ["skill"],
            "core.skills.files": ["skills_from"],
            "core.skills.simulation": ["Simulation"],
            "core.skills.values": ["PersonName", "RoomName", "ThingName"],
            "generation.generate": ["Generation", "generate"],
            "models.base": ["ModelError"],
            "models.sampling": ["SamplingSettings"],
            "prompts": ["prompt_for"],
            "prompts.extract": ["program_of"],
            "simulator.worker": ["EngineError"],
        },
    )
