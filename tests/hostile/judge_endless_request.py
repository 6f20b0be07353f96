"""Tries to fill a record with the message of the robot's error."""
# ends: robot-error GoToInvalidLocation
# does: goto xxx...


def task_program():
    go_to("x" * 10_000)
