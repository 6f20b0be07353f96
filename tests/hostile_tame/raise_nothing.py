"""Raises again where there is nothing to be raised, and in functions called from handlers."""
# tame: yes
def again():
    raise

def task_program():
    try:
        try:
            1 / 0
        except ZeroDivisionError:
            again()
    except ArithmeticError as error:
        say(repr(error))
    try:
        pass
    finally:
        raise
