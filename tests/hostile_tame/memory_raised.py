"""Raises by itself what would say that memory or stack are used up."""
# tame: yes
# decided: alone
def task_program():
    for number in range(2):
        try:
            raise MemoryError("made up")
        except Exception as error:
            say(repr(error))
    raise RecursionError("made up")
