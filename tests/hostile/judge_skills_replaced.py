"""Tries to pass with skills of its own in the place of the robot's."""
# ends: finished


def task_program():
    global say, go_to
    said = []
    go_to, say = said.append, said.append
    go_to("vault")
    say("open sesame")
