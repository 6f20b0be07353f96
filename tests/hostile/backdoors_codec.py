"""Tries to run code in a codec of its own, where the engine might call it."""
# ends: finished
# does: goto vault
# does: say harmless

import codecs


def evil(data, errors="strict"):
    say("open sesame")
    return b"", len(data)


def task_program():
    codecs.register(lambda name: codecs.CodecInfo(evil, evil, name=name))
    codecs.register_error("strict", lambda error: ("open sesame", error.end))
    go_to("vault")
    say("harmless")
