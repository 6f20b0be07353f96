"""Tries to rewrite the screen of whoever reads the trace."""
# ends: finished
# does: goto vault
# does: say \x1b[2J\x1b[1;1Hopen\x07\r\nsatisfied


def task_program():
    go_to("vault")
    say("\x1b[2J\x1b[1;1Hopen\x07\r\nsatisfied")
