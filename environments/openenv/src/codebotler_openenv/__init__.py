"""RoboEval's training tasks as an environment for the library openenv."""

from codebotler_openenv.client import CodebotlerEnv
from codebotler_openenv.models import CodebotlerAction, CodebotlerObservation, CodebotlerState, Message

__all__ = ["CodebotlerAction", "CodebotlerEnv", "CodebotlerObservation", "CodebotlerState", "Message"]
