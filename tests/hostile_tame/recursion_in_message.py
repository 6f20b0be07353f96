"""Ends with an error whose message is nested too deeply to be shown."""
# tame: yes
# decided: alone
def task_program():
    nested = 5
    for number in range(20_000):
        nested = {number: nested}
    raise ValueError(nested)
