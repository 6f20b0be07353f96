"""Recurs through keys of sorts, where C and Python take turns."""
# tame: yes
# decided: alone
def deep(n):
    return max([n], key=lambda each: sorted([each + 1], key=deep)[0])

def task_program():
    try:
        deep(0)
    except RuntimeError:
        say("too deep")
