"""Tries to forget that the engine has said stop."""
# ends: timeout TimeoutError
# does: 1000 times say a


def task_program():
    run = [c.cell_contents for c in say.__globals__["perform"].__closure__ if hasattr(c.cell_contents, "has_reached_limit")][0]
    while True:
        run.has_reached_limit = False
        try:
            say("a")
        except BaseException:
            pass
