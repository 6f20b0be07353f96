"""Says a string that is too long by one character."""
# tame: yes
def task_program():
    say("x" * 10_000)
    say("é" * 10_000)
    say("x" * 10_001)
