"""The isolated side of the engine: processes that prepare programs, and fork closed children that run them.

The child of one run holds only the program, and requests skills over a socket. The child of a batch
(`batches`) also holds copies of worlds and robots; the engine keeps the robot and trace that count. All of
this runs under a bare interpreter with few imports, since every page of memory slows each fork down.
"""

# The interpreter's options: no site, no user's folder, no unsafe path, no bytecode written, no warnings.
FLAGS = ("-S", "-s", "-P", "-B", "-W", "ignore")

# Roles: compile programs; fork batches of tame programs; fork runs; fork runs on a robot.
PREPARER, BATCH_SERVER = "preparer", "batch-fork-server"
FORK_SERVER, LIVE_SERVER = "fork-server", "live-fork-server"

CHANNEL = 3  # the descriptor between a closed process and the engine
HEADER, MAX_FRAME = 4, 1_000_000  # bytes of the length before each frame, and of a frame
PIECE, MORE = 16_384, "more"  # bytes of a message that a child reads at a time, and its request for the next
WITHOUT_REFERENCES = 2  # format of marshal; later ones depend on other objects of the writing process

MEMORY = 512 * 1024 * 1024  # bytes of address space of an isolated process
BATCH_MEMORY = 384 * 1024 * 1024  # less for a batch, so that a run alone has room for all that a batch had
CPU_SECONDS = 5  # of processor time; ends one long call into C, which uses no fuel
BATCH_CPU_SECONDS = 2  # of a batch; unfinished runs are repeated in processes of their own
LIVE_CPU_SECONDS = 3600  # on a robot, where a run may take all day, and somebody watches it
MAX_CODE = 10_000_000  # bytes of a program's compiled code

PROGRAM = "<program>"  # the file name in a program's code

# Names of the functions that compiled programs call in addition; no source text can spell them.
FUEL, CAUGHT, ENTRY, ENTER, BY_NAME = "<fuel>", "<caught>", "<entry>", "<enter>", "<by-name>"

# First byte of the preparer's answer: before code, code of a tame program, or the reason for a refusal.
PLAIN, TAME, REFUSED = b"p", b"t", b"-"
