"""Says half a character, which no message can hold."""
# tame: yes
# decided: alone
def task_program():
    say("\ud83d")
    say("x")
