"""Tries to leave the module with names deleted, declared and bound anew."""
# tame: yes
x: list[int] = [1]
y: "anything at all"

def task_program():
    global x, task
    task = 5
    del x
    say(str(task))
    del task
    x
