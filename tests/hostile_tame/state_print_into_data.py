"""Tries to let data take the place of the standard output."""
# tame: yes
def task_program():
    for file in ("x", 5, [], get_all_rooms()):
        try:
            print("x", file=file)
        except AttributeError as error:
            say(str(error))
