"""Runs programs in simulated worlds, in isolated processes. Start reading with `worker.py`."""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from codebotler.core.trace import Outcome
    from codebotler.core.world import World


def run(program: str, world: World, *, require_isolation: bool = False) -> Outcome:
    """Run one program in one world with the paper's settings. For many programs, `engine.run` is faster.

    Args:
        program: the source code, valid or not.
        world: the world's initial state.
        require_isolation: fail, instead of warn, if the kernel does not support seccomp.

    Returns:
        how the run ended, and the trace of the robot's actions.

    Raises:
        EngineError: no isolated process can be started, or the required isolation is unavailable.
    """
    # Import late: isolated processes import this package and must stay small.
    from codebotler.simulator.engine import run as run_pairs  # noqa: PLC0415 - see above

    (outcome,) = run_pairs([(program, world)], workers=1, require_isolation=require_isolation)
    return outcome
