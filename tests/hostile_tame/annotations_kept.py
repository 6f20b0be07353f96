"""Tries to let errors keep the types that annotations name, and shows them."""
# tame: yes
try:
    a: int[list] = 1
except TypeError as error:
    kept = error
try:
    b: float[int | dict[str, list]] = 2
except TypeError as error:
    other = error

def task_program(given: "x" = None, *rest: str, **others: str) -> list[str]:
    say(str(kept) + repr(kept) + str(other))
    c: int[list]
    raise kept
