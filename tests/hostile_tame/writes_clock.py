"""Takes the function of the clock and puts another in its place."""
# tame: no
def task_program():
    time.sleep = print
