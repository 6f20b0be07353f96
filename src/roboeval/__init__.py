"""How good are language models at writing programs for service robots?"""

from __future__ import annotations

__all__ = [
    "Completion",
    "Suite",
    "evaluate",
    "load_suite",
    "read_completions",
    "recorded_completions",
    "reward",
]

TYPE_CHECKING = False
if TYPE_CHECKING:
    from roboeval.records import Completion, read_completions, recorded_completions
    from roboeval.rewards import reward
    from roboeval.suite import Suite, load_suite
    from roboeval.verdicts import evaluate
else:  # a name is imported when it is first used, as in `codebotler`
    HOMES = {
        "Completion": "records",
        "Suite": "suite",
        "evaluate": "verdicts",
        "load_suite": "suite",
        "read_completions": "records",
        "recorded_completions": "records",
        "reward": "rewards",
    }

    def __getattr__(name: str) -> object:
        if name not in HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}", name=name)
        from importlib import import_module  # noqa: PLC0415 - only where something is used

        globals()[name] = value = getattr(import_module(f"{__name__}.{HOMES[name]}"), name)
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})
