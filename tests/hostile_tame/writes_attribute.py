"""Writes an attribute that it may read."""
# tame: no
def task_program():
    time.localtime().tm_year = 5
