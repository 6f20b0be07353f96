"""Tasks to train on, in families, with prompts, and rewards in parts.

Start with `families.py`. The tasks of the suites that ship with RoboEval never train.
"""

from __future__ import annotations

__all__ = ["Components", "Rollout", "family_names", "judge", "load_prompts", "trained_task"]

TYPE_CHECKING = False
if TYPE_CHECKING:
    from roboeval.training.families import family_names, trained_task
    from roboeval.training.prompts import load_prompts
    from roboeval.training.rollouts import Components, Rollout, judge
else:  # each name is imported when it is first used
    from codebotler.core.facade import facade

    __getattr__, __dir__ = facade(
        __name__,
        {
            "families": ["family_names", "trained_task"],
            "prompts": ["load_prompts"],
            "rollouts": ["Components", "Rollout", "judge"],
        },
    )
