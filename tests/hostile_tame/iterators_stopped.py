"""Raises StopIteration where it ends what a builtin goes through, and where it may not."""
# tame: yes
def stops(x):
    raise StopIteration(x)

def task_program():
    say(str(list(map(stops, [1, 2]))) + str(sorted(zip([1], map(stops, [1])))))
    try:
        list(stops(x) for x in [1])
    except RuntimeError as error:
        say(str(error))
    [stops(x) for x in [1]]
