"""Says texts that are too long in all."""
# tame: yes
# decided: alone
def task_program():
    for number in range(1000):
        say(str(number % 10) * 9_999)
