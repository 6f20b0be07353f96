"""Runs its task by itself, under another name and from within."""
# tame: yes
def task_program():
    say("task")

def helper():
    def task_program():
        say("inner")
    task_program()
