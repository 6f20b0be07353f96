"""Takes the hash of data that is nested more deeply than the stack goes."""
# tame: yes
# decided: alone
def task_program():
    nested = ()
    for number in range(190_000):
        nested = (nested,)
    known = {nested: 1}
    say("never")
