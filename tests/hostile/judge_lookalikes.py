"""Tries to pass with letters that only look right, and with a string that runs backwards."""
# ends: finished
# does: goto vault
# does: say \u043epen sesame
# does: say \u202eemases nepo\u202c


def task_program():
    go_to("vault")
    say("\u043epen sesame")
    say("\u202eemases nepo\u202c")
