"""Functions that tests call in closed processes."""

import os
import socket
from contextlib import suppress
from pathlib import Path

from codebotler.simulator.process.isolated_call import isolated


@isolated("hello")
def echo(text: str, times: int = 1) -> list[str]:
    """The text, some times."""
    return [text] * times


@isolated("")
def process_number(_text: str) -> int:
    """The number of the process that answers."""
    return os.getpid()


@isolated("1")
def compute(text: str) -> int:
    """Something that takes as long as the text says."""
    return sum(range(int(text)))


@isolated("1")
def fill(text: str) -> int:
    """Something that takes as many bytes as the text says."""
    return len(bytearray(int(text)))


@isolated("")
def end(text: str) -> str:
    """What ends the process, if it is not a rehearsal."""
    if text:
        os._exit(3)
    return text


@isolated("")
def fail(text: str) -> str:
    """What raises an error, if it is not a rehearsal."""
    if text:
        raise KeyError(text)
    return text


@isolated("")
def reach(text: str) -> list[str]:
    """What of a file, a socket and the environment can be reached."""
    found = [f"{name}={value}" for name, value in os.environ.items() if "KEY" in name]
    for name, reach_for in (("file", Path(text).read_bytes), ("socket", socket.socketpair)):
        with suppress(OSError):
            reach_for()
            found.append(name)
    return found if text else []
