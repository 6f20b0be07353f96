"""Tells how deep it could go, where a recursion that is too deep is caught."""
# tame: yes
# decided: alone
def deep(n):
    try:
        return deep(n + 1)
    except RecursionError:
        return n

def task_program():
    say(str(deep(0)))
