"""The worlds in which mutants are tried."""

from __future__ import annotations

from codebotler.badinput import BadInput
from roboeval.suite import Scenario, Suite, Task


def worlds_of(suite: Suite, task: Task, count: int | None, seed: int) -> tuple[Scenario, ...]:  # noqa: ARG001 - of suites that make worlds
    """The worlds of a task with what they require.

    Args:
        suite: of the task.
        task: the task.
        count: how many worlds to make; None for as many as the suite finds fit.
        seed: from which they are made, another one than the suite's own.

    Raises:
        BadInput: worlds are to be made, and the suite's are all written out.
    """
    if count is not None:
        raise BadInput(
            f'the worlds of the suite "{suite.name}" are written out, and no further ones can be made; '
            "leave --worlds out"
        )
    return task.scenarios
