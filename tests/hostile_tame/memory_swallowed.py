"""Asks for more memory than there is, and lets `finally` swallow that."""
# tame: yes
# decided: alone
def hungry():
    try:
        return [0] * 10**12
    finally:
        return "fed"

def task_program():
    say(hungry())
