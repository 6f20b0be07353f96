"""Lets parameters and loops take the names of builtins, skills and `time`."""
# tame: yes
def shown(len, /, *str, time=5, **say):
    def inner():
        return [len, str, time, say]
    return inner()

def task_program():
    for sorted in [3, 4]:
        pass
    try:
        raise ValueError(sorted)
    except ValueError as max:
        text = f"{max!r}"
    go_to = shown(1, 2, time=3, max=sorted)
    say(text + repr(go_to))
    max
