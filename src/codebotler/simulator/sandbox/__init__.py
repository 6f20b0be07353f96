"""The isolated side of the engine: code that compiles programs, and processes that fork children to run them.

The child of a single run holds only the program, and requests skills over a socket. The child of a batch (see
`batches`) also holds copies of worlds and robots, but the engine's own robot and trace are authoritative. All
this runs in a bare interpreter with few imports, since every page of memory slows down each fork.
"""

# Interpreter options: no site module, no user site folder, no unsafe path, no bytecode files, no warnings.
FLAGS = ("-S", "-s", "-P", "-B", "-W", "ignore")

CHANNEL = 3  # the descriptor that connects a closed process to the engine
HEADER, MAX_FRAME = 4, 1_000_000  # bytes of the length that precedes a frame, and of the frame
SIMULATED_RUN, LIVE_RUN = b"s", b"l"  # requests to a fork server for a child
READY = '"ready"'  # the first message of a child, once it is isolated
WITHOUT_REFERENCES = 2  # marshal format; the output of later formats depends on reference counts

MEMORY = 512 * 1024 * 1024  # bytes of address space of an isolated process
BATCH_MEMORY = 384 * 1024 * 1024  # less than MEMORY, so that a single run never has less room than a batch
CPU_SECONDS = 5  # processor time; stops long calls into C, which use no fuel
BATCH_CPU_SECONDS = 2  # processor time of a batch; unfinished runs are repeated in their own processes
LIVE_CPU_SECONDS = 3600  # processor time of a live run, which may take all day and is supervised
MAX_CODE = 10_000_000  # bytes of a program's compiled code

PROGRAM = "<program>"  # the file name of a program's code

# Names of the functions that we insert into compiled programs, which no source text can spell.
FUEL, CAUGHT, ENTRY, ENTER, BY_NAME = "<fuel>", "<caught>", "<entry>", "<enter>", "<by-name>"
