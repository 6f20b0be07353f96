"""Tries to import the engine's side of the simulator."""
# ends: finished

import inspect


def task_program():
    for name in (
        "codebotler.world",
        "codebotler.trace",
        "codebotler.simulator.robot",
        "codebotler.simulator.engine",
        "roboeval.verdicts",
        "roboeval.suite",
        "pydantic",
        "yaml",
    ):
        try:
            inspect.importlib.import_module(name)
            say(name)
        except ModuleNotFoundError:
            pass
