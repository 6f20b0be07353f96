"""Tries to get the frame of an error."""
# tame: no
def task_program():
    try:
        1 / 0
    except ZeroDivisionError as error:
        say(str(error.__traceback__.tb_frame.f_back))
