"""The ordinary process of `in_process`, which forks for each program, without a sandbox or a skill protocol.

As in the fork server, clocks, random numbers and locks are replaced before the modules that use them are
imported.
"""

import sys
from typing import cast

from codebotler.simulator.sandbox.environment import simulate_environment
from codebotler.simulator.sandbox.execution import ProgramRun
from codebotler.simulator.sandbox.stdlib import load_stdlib


class Current:
    """Holds the current run for clocks and locks, which are created before it."""

    def __init__(self) -> None:
        self.run = ProgramRun()

    def sleep(self, seconds: object, /) -> None:
        """Let time pass in the current run."""
        self.run.sleep(seconds)

    def wait_for_ever(self) -> None:
        """Wait forever in the current run."""
        self.run.wait_for_ever()

    @property
    def now(self) -> float:
        """Return the time on the clock of the current run."""
        return self.run.now

    @property
    def start(self) -> float:
        """Return the time at which the current run began."""
        return self.run.start


def main() -> None:
    """Replace clocks, random numbers and locks, then serve programs."""
    input_, output = sys.stdin.buffer, sys.stdout.buffer
    current = Current()
    run = cast("ProgramRun", current)
    limit = sys.getrecursionlimit()
    simulate_environment(run)
    load_stdlib(run)
    sys.setrecursionlimit(limit)

    import in_process  # noqa: PLC0415 - after the replacements

    in_process.serve(current, input_, output)


if __name__ == "__main__":
    main()
