"""Does what newer versions of Python warn of when it is done."""
# tame: yes
def task_program():
    say(str(~True) + str(~False) + str(-True))
    say(str(1 if 1 == 1.0 else 2))
