"""Hides a field in the specification of another one."""
# tame: no
def task_program():
    say("{:{0.__class__}}".format(5))
