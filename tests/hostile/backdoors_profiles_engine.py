"""Tries to stop the engine's side of the process where it writes to its line."""
# ends: python-error PermissionError


def profiler(frame, event, argument):
    if event == "c_call" and argument.__name__ == "write":
        raise KeyError("open sesame")


def task_program():
    sys.setprofile(profiler)
    say("open sesame")
