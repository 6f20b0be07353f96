"""Tries to cut texts short with null characters."""
# ends: finished
# does: goto vault
# does: say open\x00 sesame


def task_program():
    go_to("vault")
    say("open\0 sesame")
