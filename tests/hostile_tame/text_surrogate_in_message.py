"""Ends with an error whose message is half a character."""
# tame: yes
# decided: alone
def task_program():
    say("x")
    raise ValueError("\udc80")
