"""Errors of isolated processes."""


class LostProcessError(Exception):
    """A process ended before it was isolated, through no fault of the program."""


class ProtocolError(Exception):
    """The program has written to the channel: our own code never sends such messages."""
