"""Tells how deep it could go, where `return` in `finally` swallows the error."""
# tame: yes
# decided: alone
def deep(n):
    try:
        return deep(n + 1)
    finally:
        return n

def task_program():
    for tried in range(2):
        try:
            deep(0)
        finally:
            continue
    say("went on")
