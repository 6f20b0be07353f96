"""Makes a function that stops in the middle, and never ends it."""
# tame: no
def waits():
    try:
        yield 1
    finally:
        say("closed")

def task_program():
    for number in waits():
        raise ValueError(number)
