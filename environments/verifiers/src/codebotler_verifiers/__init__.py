"""RoboEval's training tasks as an environment for the library verifiers."""

from codebotler_verifiers.environment import TrainingEnv, TrainingEnvConfig
from codebotler_verifiers.missions import MissionState, MissionToolset
from codebotler_verifiers.taskset import (
    TrainingConfig,
    TrainingData,
    TrainingTask,
    TrainingTaskset,
    TrainingTrace,
)

__all__ = [
    "MissionState",
    "MissionToolset",
    "TrainingConfig",
    "TrainingData",
    "TrainingEnv",
    "TrainingEnvConfig",
    "TrainingTask",
    "TrainingTaskset",
    "TrainingTrace",
]
