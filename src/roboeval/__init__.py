"""How good are language models at writing programs for service robots?"""

from __future__ import annotations

from codebotler import __version__

__all__ = [
    "Completion",
    "Row",
    "Suite",
    "__version__",
    "evaluate",
    "load_suite",
    "read_completions",
    "recorded_completions",
    "reward",
]

TYPE_CHECKING = False
if TYPE_CHECKING:
    from roboeval.records import Completion, Row, read_completions, recorded_completions
    from roboeval.rewards import reward
    from roboeval.suite import Suite, load_suite
    from roboeval.verdicts import evaluate
else:  # each name is imported when it is first used
    from codebotler.facade import facade

    __getattr__, __dir__ = facade(
        __name__,
        {
            "Completion": "records",
            "Row": "records",
            "Suite": "suite",
            "evaluate": "verdicts",
            "load_suite": "suite",
            "read_completions": "records",
            "recorded_completions": "records",
            "reward": "rewards",
        },
    )
