"""The isolated side of the engine: processes that prepare programs, and fork one closed child for each run.

A child holds the program and nothing else: the world, the robot and the trace stay with the engine, and the
child asks for skills over a socket. Everything it says is checked there; here is only what keeps it in. All
of it runs under a bare interpreter and imports as little as it can, since every page of memory and every
library makes each fork dearer.
"""

FLAGS = ("-S", "-s", "-P", "-B", "-W", "ignore")
"""The interpreter's options: no site, no user's folder, no unsafe path, no bytecode written, no warnings."""

CHANNEL = 3
"""The descriptor by which a closed process and the engine talk: HEADER bytes of length, then content."""

HEADER, MAX_FRAME = 4, 1_000_000

PIECE, MORE = 16_384, "more"
"""Bytes of a message to a child that it gets at once, and what it says when it wants the next."""

MEMORY = 512 * 1024 * 1024
"""Bytes of address space of an isolated process."""

CPU_SECONDS = 5
"""Seconds of processor time of a closed process, against what ticks cannot see, such as one long call."""

LIVE_CPU_SECONDS = 3600
"""The same for a run on a robot, which may take all day, and which somebody watches."""

WITHOUT_REFERENCES = 2
"""The version of marshal's format: later ones write what depends on what else the writing process holds."""

PREPARER, FORK_SERVER, LIBRARY_SERVER, LIVE_SERVER = (
    "preparer",
    "fork-server",
    "library-fork-server",
    "live-fork-server",
)
"""The roles: who compiles programs; who forks runs, those that import something, and those on a robot."""

PROGRAM = "<program>"
"""The file that a program's code says it comes from."""

TICK, ENTRY, ENTER, BY_NAME = "<tick>", "<entry>", "<enter>", "<by-name>"
"""Names of what counts in a program's code; no source text can spell them."""

ACTS, TELLS, LOOKS = 0, 1, 2
"""How a skill is called: waiting for its result; without waiting, since there is none and it cannot fail; and
waiting only until the result is known, which then stays as it is until the robot acts."""

MAX_CODE = 10_000_000
"""Bytes of a program's compiled code."""

PLAIN, IMPORTING, REFUSED = b"p", b"i", b"-"
"""What the preparer's answer begins with: before the code of a program, before that of one which imports more
than is always there, and before the reason why there is none."""
