"""Calls what stands for data here, and for a builtin elsewhere."""
# tame: yes
def called(len):
    return len(5)

def task_program():
    try:
        called([1])
    except TypeError as error:
        text = str(error)
    say(text + str(len("abc")))
    time(1)
    time = 5
