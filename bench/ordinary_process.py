"""The ordinary process of `in_process`: forks for each program, closes no walls, asks the robot directly.

Clocks, chance and locks are replaced first, as in the fork server, before the modules that take them for
their own are imported.
"""

import sys
from typing import cast

from codebotler.simulator.sandbox.environment import simulate_environment
from codebotler.simulator.sandbox.execution import ProgramRun
from codebotler.simulator.sandbox.stdlib import load_stdlib


class Current:
    """The run that goes on; clocks and locks are made before it is."""

    def __init__(self) -> None:
        self.run = ProgramRun()

    def sleep(self, seconds: object, /) -> None:
        """Let time pass in it."""
        self.run.sleep(seconds)

    def wait_for_ever(self) -> None:
        """Wait in it."""
        self.run.wait_for_ever()

    @property
    def now(self) -> float:
        """What its clock shows."""
        return self.run.now

    @property
    def start(self) -> float:
        """When it began."""
        return self.run.start


def main() -> None:
    """Be the ordinary process."""
    input_, output = sys.stdin.buffer, sys.stdout.buffer
    current = Current()
    run = cast("ProgramRun", current)
    limit = sys.getrecursionlimit()
    simulate_environment(run)
    load_stdlib(run)
    sys.setrecursionlimit(limit)

    import in_process  # noqa: PLC0415 - only now

    in_process.serve(current, input_, output)


if __name__ == "__main__":
    main()
