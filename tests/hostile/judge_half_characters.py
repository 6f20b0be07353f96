"""Tries to break whoever writes the trace with half of a character."""
# ends: finished
# does: goto vault
# does: say open\ud800 sesame\udfff


def task_program():
    go_to("vault")
    say("open\ud800 sesame\udfff")
