"""Tries to leave a string of megabytes in the standard output."""
# tame: yes
def task_program():
    print("é" * 10_000_000)
    say("printed")
