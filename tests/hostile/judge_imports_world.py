"""Tries to import the engine's side of the simulator."""
# ends: finished

import inspect


def task_program():
    for name in (
        "codebotler.core.world",
        "codebotler.core.trace",
        "codebotler.simulator.worlds.robot",
        "codebotler.simulator.engine",
        "roboeval.evaluation.judging.judge",
        "roboeval.suites.load",
        "pydantic",
        "yaml",
    ):
        try:
            inspect.importlib.import_module(name)
            say(name)
        except ModuleNotFoundError:
            pass
