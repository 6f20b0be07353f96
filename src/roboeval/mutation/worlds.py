"""The worlds in which mutants are tried."""

from __future__ import annotations

from codebotler.arguments import expect_whole
from codebotler.badinput import BadInput
from roboeval.suites.load import Scenario, Suite, Task
from roboeval.suites.schema import MOST_WORLDS

COUNT = 200
"""How many worlds a suite makes for mutants, if nobody says another number."""


def worlds_of(suite: Suite, task: Task, count: int | None, seed: int) -> tuple[Scenario, ...]:
    """The worlds of a task with what they require.

    Args:
        suite: of the task.
        task: the task.
        count: how many to make, 1 to 10,000; by default 200, or those that are written out where all are.
        seed: from which they are made; never the one of the suite's own worlds.

    Raises:
        BadInput: worlds are to be made, and all of the suite's are written out; or they are too many.
    """
    if count is not None:
        expect_whole(count, "the number of worlds", least=1, most=MOST_WORLDS)
    if suite.further is not None:
        return suite.further(task, count or COUNT, seed + 1 + (suite.seed or 0))
    if count is not None:
        raise BadInput(
            f'the worlds of the suite "{suite.name}" are written out, and no further ones can be made; '
            "leave --worlds out"
        )
    return task.scenarios
