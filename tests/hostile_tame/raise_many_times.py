"""Raises one error again and again, so that its traceback grows."""
# tame: yes
kept = None

def again(error):
    raise error

def task_program():
    global kept
    try:
        place("x")
    except Exception as error:
        kept = error
    for number in range(2000):
        try:
            again(kept)
        except Exception as error:
            kept = error
    raise kept
