"""Offers an option that is nested too deeply to be shown."""
# tame: yes
# decided: alone
def task_program():
    nested = ()
    for number in range(20_000):
        nested = (nested,)
    ask("", "Which?", [nested])
