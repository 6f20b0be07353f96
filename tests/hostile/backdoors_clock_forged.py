"""Tries to run in the far future."""
# ends: timeout TimeoutError


def task_program():
    run = [c.cell_contents for c in say.__globals__["perform"].__closure__ if hasattr(c.cell_contents, "has_reached_limit")][0]
    run.now = 1e12
    say("open sesame")
