"""Offers so many options that their message is too long."""
# tame: yes
# decided: alone
def task_program():
    ask("", "Which?", [str(number) for number in range(100_000)])
