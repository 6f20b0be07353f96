"""Tries to leave a skill no room to be called."""
# ends: finished
# does: goto vault
# does: say open sesame
# earns: yes


def task_program():
    sys.setrecursionlimit(40)
    go_to("vault")
    say("open sesame")
