"""Tries to leave a list in the middle of its sort, empty as it then seems."""
# tame: yes
numbers = [3, 1, 2]

def key(number):
    say(str(numbers))
    numbers.append(number)
    if number == 2:
        raise KeyError(number)
    return number

def task_program():
    try:
        numbers.sort(key=key)
    except KeyError as error:
        say(repr(error))
    try:
        numbers.sort(key=lambda number: numbers.append(0) or number)
    except ValueError as error:
        say(str(error))
    say(str(numbers))
