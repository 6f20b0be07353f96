"""Tries to leave all fuel spent, from handlers that go on for ever."""
# tame: yes
def task_program():
    while True:
        try:
            while True:
                pass
        except BaseException:
            continue
        finally:
            say("never")
