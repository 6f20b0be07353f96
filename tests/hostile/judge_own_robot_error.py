"""Tries to end with an error that looks like the robot's."""
# ends: python-error GoToInvalidLocation


class GoToInvalidLocation(Exception):
    number = 0


def task_program():
    raise GoToInvalidLocation("there is no room")
