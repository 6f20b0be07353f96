"""Goes as deep as it is allowed to, but not deeper, and speaks there."""
# tame: yes
def deep(n):
    if n == 0:
        say("at the bottom")
        return [[]]
    return [deep(n - 1)]

def task_program():
    say(str(len(str(deep(80)))))
