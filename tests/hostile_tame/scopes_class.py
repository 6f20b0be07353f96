"""Makes a class whose instances say something when they go."""
# tame: no
class Last:
    def __del__(self):
        say("gone")

def task_program():
    Last()
