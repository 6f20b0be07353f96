"""Programs run in simulated worlds, in isolated processes; start reading at `worker.py`."""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from codebotler.core.trace import Outcome
    from codebotler.core.world import World


def run(program: str, world: World, *, require_isolation: bool = False) -> Outcome:
    """Run one program in one world with the paper's settings; `engine.run` is quicker for many.

    Args:
        program: its source, valid or not.
        world: the initial state.
        require_isolation: whether to fail where the kernel has no seccomp, rather than warn.

    Returns:
        how the run ended, with the trace of the robot's actions.

    Raises:
        EngineError: no isolated process could be started, or the required isolation is missing.
    """
    # Isolated processes import this package, and must stay small.
    from codebotler.simulator.engine import run as run_pairs  # noqa: PLC0415 - see above

    (outcome,) = run_pairs([(program, world)], workers=1, require_isolation=require_isolation)
    return outcome
