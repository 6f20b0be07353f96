"""Tries to leave text behind in the standard output, whole and in parts."""
# tame: yes
def task_program():
    print("x" * 8191, end="")
    print("\ud800", "\x00", sep="\r", end="\n\n", flush=True)
    print(*[1, 2], sep=None, end=None, file=None)
    try:
        print(1, end=2)
    except TypeError as error:
        say(str(error))
