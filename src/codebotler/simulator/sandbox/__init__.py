"""The isolated side of the engine: a zygote that forks one closed child for each run of a program.

A child holds the program and nothing else: the world, the robot and the trace stay with the engine, and the
child asks for skills over a socket. Everything it says is checked there; here is only what keeps it in. The
zygote runs under a bare interpreter, so nothing here imports more than the standard library.
"""

from pathlib import Path

ZYGOTE = Path(__file__).with_name("zygote.py")
"""The script that the engine starts."""

FLAGS = ("-S", "-s", "-P", "-B")
"""The interpreter's options: no site, no user's folder, no unsafe path, no bytecode written."""
