"""Tries to leave the clock of its process where the next run would start."""
# tame: yes
def task_program():
    say(str(time.monotonic()) + str(time.time()))
    time.sleep(0.1)
    time.sleep(1 / 3)
    time.sleep(5e-324)
    say(time.ctime())
    time.sleep(3599)
    say("never")
