"""Errors of isolated processes, and of the engine that starts them."""


class EngineError(RuntimeError):
    """The engine itself failed, through no fault of a program."""


class LostProcessError(Exception):
    """A process ended through no fault of the program, for example before it was isolated."""


class ProtocolError(Exception):
    """The program must have written to the channel, since our own code never sends this message."""
