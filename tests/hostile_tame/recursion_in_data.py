"""Compares and shows data that is nested too deeply, and catches that."""
# tame: yes
# decided: alone
def task_program():
    one, other = [], []
    for number in range(20_000):
        one, other = [one], [other]
    try:
        say(str(one == other))
    except RecursionError as error:
        say("too deep to compare")
    try:
        say(str(one))
    except RecursionError as error:
        say("too deep to show")
