"""Tries to turn the clock back."""
# ends: finished
# does: say a
# does: say b
# does: say c

import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    time.sleep(10)
    say("a")
    os.write(3, frame('["say", ["b"], -1e9]'))
    os.read(3, int.from_bytes(os.read(3, 4), "big"))
    say("c")
