"""Says a string that is far too long, and catches what comes of it."""
# tame: yes
def task_program():
    try:
        say("x" * 60_000)
    except BaseException as error:
        say(repr(error))
