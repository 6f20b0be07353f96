"""Tells how deep it could go, where `break` in `finally` swallows the error."""
# tame: yes
# decided: alone
deepest = 0

def deep(n):
    global deepest
    deepest = max(deepest, n)
    for tried in (1,):
        try:
            deep(n + 1)
        finally:
            break
    return n

def task_program():
    deep(0)
    say(str(deepest))
