"""Sleeps for a number of seconds that no clock can show."""
# tame: yes
def task_program():
    for seconds in (-1, float("inf"), "1", None, 10**400):
        try:
            time.sleep(seconds)
        except (ValueError, TypeError) as error:
            say(str(error))
