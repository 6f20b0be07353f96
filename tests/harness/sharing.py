"""Which tests one process runs together: those with the same parameter, which share costly things."""

from __future__ import annotations

from xdist.scheduler import LoadScopeScheduling


class ByParameter(LoadScopeScheduling):  # type: ignore[misc]  # xdist has no types
    """Gives each process all tests of one parameter, up to a colon in it, at a time; and all that have none.

    xdist's own groups go by marks, which are lost with this version of pytest.
    """

    def _split_scope(self, nodeid: str) -> str:
        file, _, parameter = nodeid.partition("[")
        return parameter.rstrip("]").partition(":")[0] or file.partition("::")[0]
