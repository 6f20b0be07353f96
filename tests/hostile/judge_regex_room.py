"""Tries to drive by a pattern that fits every room."""
# ends: robot-error GoToInvalidLocation
# does: goto .*


def task_program():
    go_to(".*")
