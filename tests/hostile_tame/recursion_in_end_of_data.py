"""Lets go of data that is nested deeply, all at once."""
# tame: yes
def task_program():
    nested = None
    for number in range(50_000):
        nested = [nested] if number % 2 else {number: (nested,)}
    nested = None
    error = None
    for number in range(5_000):
        try:
            raise ValueError from error
        except ValueError as raised:
            error = raised
    error = None
    say("all gone")
