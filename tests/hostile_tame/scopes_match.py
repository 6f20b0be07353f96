"""Binds names by patterns."""
# tame: no
def task_program():
    match 5:
        case len:
            say(str(len))
