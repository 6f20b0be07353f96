"""Tries to unpack a bomb through a codec."""
# ends: python-error LookupError

import codecs


def task_program():
    codecs.decode(b"x\x9c", "zlib")
