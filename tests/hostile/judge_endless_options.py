"""Tries to fill a record with the options that the robot's error lists, again and again."""
# ends: timeout TimeoutError
# does: goto vault
# does: 9 times ask which: 10 times xxx...


def task_program():
    go_to("vault")
    while True:
        try:
            ask("amy", "which", ["x" * 9_999] * 10)
        except Exception:
            pass
