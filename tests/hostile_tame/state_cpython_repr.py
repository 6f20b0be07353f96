"""Tries to leave the interpreter in the middle of a repr of something that holds itself."""
# tame: yes
def task_program():
    held = []
    for number in range(3):
        held.append([held, {number: held}, (held,)])
    say(repr(held))
    held[0][0] = float("nan")
    say(repr(held) + str(held in [held]) + str(held != held))
