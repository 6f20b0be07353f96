"""Tries to pass by saying the right thing in the wrong room and visiting the right one afterwards."""
# ends: finished
# does: say open sesame
# does: goto vault


def task_program():
    say("open sesame")
    go_to("vault")
