"""Tries to change a text in place after it was checked."""
# ends: finished
# does: say open sesame


def task_program():
    frame = sys._getframe()
    while "ctypes" not in frame.f_globals:
        frame = frame.f_back
    text = "".join(["harm", "less", "now"])
    at = id(text) + sys.getsizeof(text) - len(text) - 1
    frame.f_globals["ctypes"].memmove(at, b"open sesame", len(text))
    say(text)
