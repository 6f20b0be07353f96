"""Tries to let errors keep the types that annotations name, and shows them."""
# tame: yes
known = {}
try:
    a: known[list] = 1
except KeyError as error:
    kept = error
try:
    b: known[int | dict[str, list]] = 2
except KeyError as error:
    other = error

def task_program(given: "x" = None, *rest: known, **others: known) -> list[known]:
    say(str(kept) + repr(kept) + str(other))
    c: known[list]
    raise kept
