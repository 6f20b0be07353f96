"""Measures how well language models write programs for service robots."""

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
    from roboeval.evaluation.judging.judge import evaluate
    from roboeval.evaluation.rewards import reward
    from roboeval.evaluation.runs.completions import Completion, read_completions
    from roboeval.evaluation.runs.results import load_results
    from roboeval.evaluation.runs.rows import Row
    from roboeval.evaluation.runs.source import recorded_completions
    from roboeval.suites.load import Suite, load_suite
else:  # each name is imported when it is first used
    from codebotler.core.facade import facade

    __getattr__, __dir__ = facade(
        __name__,
        {
            "evaluation.judging.judge": ["evaluate"],
            "evaluation.rewards": ["reward"],
            "evaluation.runs.completions": ["Completion", "read_completions"],
            "evaluation.runs.results": ["load_results"],
            "evaluation.runs.rows": ["Row"],
            "evaluation.runs.source": ["recorded_completions"],
            "suites.load": ["Suite", "load_suite"],
        },
    )
