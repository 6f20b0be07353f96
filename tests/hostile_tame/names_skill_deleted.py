"""Deletes a skill for all that comes after."""
# tame: no
def task_program():
    global say
    del say
