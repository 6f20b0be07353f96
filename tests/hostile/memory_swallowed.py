"""Tries to go on after memory was refused, again and again."""
# ends: finished
# does: goto vault
# does: say open sesame
# earns: yes


def task_program():
    for _ in range(20):
        try:
            bytearray(10**12)
        except MemoryError:
            pass
    go_to("vault")
    say("open sesame")
