"""What can go wrong with an isolated process."""


class LostProcessError(Exception):
    """A process ended before it was isolated, through no fault of the program."""


class ProtocolError(Exception):
    """The program has got hold of the channel and sends what our own code never would."""
