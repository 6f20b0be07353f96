"""Takes nearly all the memory that there is, which may be there in one process and not in another."""
# tame: yes
# decided: alone
def task_program():
    numbers = [0] * 63_500_000
    say(str(len(numbers)))
