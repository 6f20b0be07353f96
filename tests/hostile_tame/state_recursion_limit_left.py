"""Tries to leave the limit of recursion lifted by failing inside a skill."""
# tame: yes
def deep(n):
    if n == 0:
        go_to("nowhere at all")
    deep(n - 1)

def task_program():
    deep(120)
