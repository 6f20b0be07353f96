"""Assigns within expressions, in scopes that are not what they seem."""
# tame: no
def task_program():
    found = [last for number in [1, 2, 3] if (last := number) > 1]
    say(str(found) + str(last) + str((y := 5) + y) + f"{(z := 6)} {z:>{(w := 9)}}")
    any((witness := room) == "kitchen" for room in get_all_rooms())
    say(witness + str(w))
    max([1], key=lambda v, w=(inside := 2): v + inside)
    say(str(inside))
