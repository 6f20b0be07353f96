"""Asks for more memory than there is, and goes on."""
# tame: yes
# decided: alone
def task_program():
    try:
        text = "x" * 10**12
    except BaseException:
        say("caught")
