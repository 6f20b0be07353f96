"""Tries to leave cycles of errors and lists for the collector of garbage."""
# tame: yes
def task_program():
    found = []
    for number in range(300):
        try:
            raise ValueError(found)
        except ValueError as error:
            if number < 3:
                found.append(error)
    say(str(found))
