"""Sleeps to the very last moment, and a little more."""
# tame: yes
def task_program():
    time.sleep(3600)
    say("still there")
    time.sleep(1e-13)
    say("still there, since that is nothing")
    time.sleep(1e-9)
    say("never")
