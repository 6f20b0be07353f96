"""Uses names before and after they mean something, in all scopes."""
# tame: yes
def outer():
    def inner():
        return later
    try:
        inner()
    except NameError as error:
        say(str(error))
    later = 1
    del later
    try:
        later
    except UnboundLocalError as error:
        say(str(error))
    return inner()

def task_program():
    try:
        outer()
    except NameError as error:
        say(str(error))
    say(str([x for x in [1]]))
    x
