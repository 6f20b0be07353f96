"""Functions that tests call in closed processes."""

import os
import socket
from contextlib import suppress
from pathlib import Path

from codebotler.simulator.process.isolated_call import isolated


@isolated("hello")
def echo(text: str, times: int = 1) -> list[str]:
    """Return the text several times."""
    return [text] * times


@isolated("")
def process_number(_text: str) -> int:
    """Return the number of the process that runs this."""
    return os.getpid()


@isolated("1")
def compute(text: str) -> int:
    """Take as long as the text says."""
    return sum(range(int(text)))


@isolated("1")
def fill(text: str) -> int:
    """Take as much memory as the text says."""
    return len(bytearray(int(text)))


@isolated("")
def end(text: str) -> str:
    """End the process, unless the call is a rehearsal with an empty text."""
    if text:
        os._exit(3)
    return text


@isolated("")
def fail(text: str) -> str:
    """Raise an error, unless the call is a rehearsal with an empty text."""
    if text:
        raise KeyError(text)
    return text


@isolated("")
def reach(text: str) -> list[str]:
    """Return the file, the socket and the secret variables that the process can reach."""
    found = [f"{name}={value}" for name, value in os.environ.items() if "KEY" in name]
    for name, reach_for in (("file", Path(text).read_bytes), ("socket", socket.socketpair)):
        with suppress(OSError):
            reach_for()
            found.append(name)
    return found if text else []
