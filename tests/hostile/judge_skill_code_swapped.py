"""Tries to make one skill do the work of another."""
# ends: finished
# does: goto open sesame


def task_program():
    scope = say.__globals__
    scope["perform"] = go_to.__globals__["perform"]
    try:
        say("open sesame")
    except Exception:
        pass
