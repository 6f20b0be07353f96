"""Programs run in simulated worlds, in isolated processes; start reading at `worker.py`."""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from codebotler.core.trace import Outcome
    from codebotler.core.world import World


def run(program: str, world: World, *, require_isolation: bool = False) -> Outcome:
    """Run one program in one world by the paper's rules; `engine.run` is quicker for many.

    Args:
        program: its source, which need not even parse.
        world: the initial state.
        require_isolation: whether to refuse where the kernel has no seccomp, rather than warn.

    Returns:
        how the run ended, with the trace of what the robot did.

    Raises:
        EngineError: no isolated process could be started, or the isolation that is required is missing.
    """
    # Isolated processes import this package, and must stay small.
    from codebotler.simulator.engine import run as run_pairs  # noqa: PLC0415 - so only now

    (outcome,) = run_pairs([(program, world)], workers=1, require_isolation=require_isolation)
    return outcome
