"""Tries to keep errors of the robot as data, and raises an early one at the end."""
# tame: yes
kept = []

def task_program():
    for name in ("nothing", "no more", "not at all"):
        try:
            pick(name)
        except Exception as error:
            kept.append(error)
    say(repr(kept) + str(kept[0] in kept) + str(kept[0] == kept[1]))
    try:
        raise kept[2] from kept[1]
    except Exception as error:
        say(str(error))
    raise kept[0]
