"""Names something by two halves of a character, which a message would join."""
# tame: yes
# decided: alone
def task_program():
    half, other = chr(0xD83D), chr(0xDE00)
    try:
        pick(half + other)
    except Exception as error:
        say(str([len(str(error)), half in str(error)]))
