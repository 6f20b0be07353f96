"""Tries to act through the object that runs it, with a clock of its own."""
# ends: finished
# does: say open sesame
# does: goto vault


def task_program():
    run = [c.cell_contents for c in say.__globals__["perform"].__closure__ if hasattr(c.cell_contents, "has_reached_limit")][0]
    run.now = 5.0
    run.request('"say",["open sesame"]')
    run.now = -5.0
    run.request('"go_to",["vault"]')
