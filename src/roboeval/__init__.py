"""How good are language models at writing programs for service robots?"""

from __future__ import annotations

from codebotler import __version__

__all__ = [
    "Completion",
    "Row",
    "Suite",
    "__version__",
    "evaluate",
    "load_results",
    "load_suite",
    "read_completions",
    "recorded_completions",
    "reward",
]

TYPE_CHECKING = False
if TYPE_CHECKING:
    from roboeval.evaluation.judge import evaluate
    from roboeval.evaluation.rewards import reward
    from roboeval.evaluation.runs.completions import Completion, read_completions, recorded_completions
    from roboeval.evaluation.runs.results import load_results
    from roboeval.evaluation.runs.rows import Row
    from roboeval.suites.load import Suite, load_suite
else:  # each name is imported when it is first used
    from codebotler.core.facade import facade

    __getattr__, __dir__ = facade(
        __name__,
        {
            "Completion": "evaluation.runs.completions",
            "Row": "evaluation.runs.rows",
            "Suite": "suites.load",
            "evaluate": "evaluation.judge",
            "load_results": "evaluation.runs.results",
            "load_suite": "suites.load",
            "read_completions": "evaluation.runs.completions",
            "recorded_completions": "evaluation.runs.completions",
            "reward": "evaluation.rewards",
        },
    )
