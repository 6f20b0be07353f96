"""Calls the functions of time with all that they do not expect."""
# tame: yes
import time as time

def task_program():
    import time
    now = time.localtime()
    say(str(now) + str(now[:3]) + str(now == time.gmtime()))
    say(time.strftime("%c %Z %z %s %x %X") + time.asctime() + time.ctime(0) + str(now[0]))
    for seconds in (10**20, float("nan"), "x", -1e15, None):
        try:
            say(str(time.gmtime(seconds)) + time.ctime(seconds))
        except Exception as error:
            say(repr(error))
    for wrong in ((), (1, 2), now[:8], "x", [now]):
        try:
            say(time.strftime("%Y", wrong) + time.asctime(wrong))
        except Exception as error:
            say(repr(error))
    time.time(1)
