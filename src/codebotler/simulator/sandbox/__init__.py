"""The isolated side of the engine: processes that prepare programs, and fork closed children that run them.

The child of one run holds nothing but the program, and asks for skills over a socket. The child of a batch
(`batches`) also holds copies of worlds and robots. The robot and the trace that count stay with the
engine. All of this runs under a bare interpreter and imports as little as it can, since every page of memory
makes each fork dearer.
"""

# The interpreter's options: no site, no user's folder, no unsafe path, no bytecode written, no warnings.
FLAGS = ("-S", "-s", "-P", "-B", "-W", "ignore")

# Roles: compiles programs; forks batches of tame programs; forks runs; forks runs on a robot.
PREPARER, BATCH_SERVER = "preparer", "batch-fork-server"
FORK_SERVER, LIVE_SERVER = "fork-server", "live-fork-server"

CHANNEL = 3  # the descriptor by which a closed process and the engine talk
HEADER, MAX_FRAME = 4, 1_000_000  # bytes of length before each frame, and of a frame
PIECE, MORE = 16_384, "more"  # bytes of a message that a child gets at once, and how it asks for the next
WITHOUT_REFERENCES = 2  # of marshal's formats: later ones depend on what else the writing process holds

MEMORY = 512 * 1024 * 1024  # bytes of address space of an isolated process
BATCH_MEMORY = (
    384 * 1024 * 1024
)  # the same of a batch, so that whatever it has room for, a run by itself has too
CPU_SECONDS = 5  # of processor time, against what fuel cannot see, such as one long call into C
BATCH_CPU_SECONDS = 2  # the same of a batch; what is under way then runs again in a process of its own
LIVE_CPU_SECONDS = 3600  # the same on a robot, where a run may take all day and somebody watches it
MAX_CODE = 10_000_000  # bytes of a program's compiled code

PROGRAM = "<program>"  # the file that a program's code says it comes from

# Names of the functions that programs call without knowing; no source text can spell them.
FUEL, CAUGHT, ENTRY, ENTER, BY_NAME = "<fuel>", "<caught>", "<entry>", "<enter>", "<by-name>"

# First byte of the preparer's answer: before code, before that of a tame program, and before the reason why
# there is no code.
PLAIN, TAME, REFUSED = b"p", b"t", b"-"
