"""Shows numbers that are too long to be shown, in a message and in an option."""
# tame: yes
def task_program():
    huge = 10**5_000
    for text in ("say", "int"):
        try:
            say(str(huge)) if text == "say" else int("9" * 5_000)
        except ValueError as error:
            say(str(error))
    ask("", "Which?", [huge])
