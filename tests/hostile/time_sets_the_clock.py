"""Tries to set the clock of the machine."""
# ends: python-error PermissionError


def task_program():
    time.clock_settime(time.CLOCK_REALTIME, 0)
