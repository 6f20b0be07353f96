"""Tries to flood the trace with empty options."""
# ends: timeout TimeoutError
# does: goto vault


def task_program():
    go_to("vault")
    ask("amy", "which", [""] * 10**6)
