"""Tries to encode, for which the interpreter keeps codecs."""
# tame: no
def task_program():
    say(str("x".encode("idna")))
