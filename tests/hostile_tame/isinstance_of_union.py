"""Makes a type of two types where only types are looked at."""
# tame: no
def task_program():
    say(str(isinstance(1, int | str)))
