"""Goes on after its last call, from handlers and from `finally`."""
# tame: yes
def task_program():
    try:
        while True:
            say("x")
    except BaseException as error:
        say(repr(error))
    finally:
        say("never")
