"""Raises what cannot be raised, from what cannot be a cause."""
# tame: yes
def task_program():
    for wrong in (5, None, "x", []):
        try:
            raise wrong
        except TypeError as error:
            say(str(error))
        try:
            raise ValueError from wrong
        except TypeError as error:
            say(str(error))
        except ValueError as error:
            say(repr(error))
    raise OSError(2, "x", "y")
