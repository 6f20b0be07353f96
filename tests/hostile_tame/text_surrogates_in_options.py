"""Offers two halves of a character, in two options and in one."""
# tame: yes
# decided: alone
def task_program():
    ask("", "Yes?", ["yes \ud83d", "\ude00", "\ud83d\ude00"])
