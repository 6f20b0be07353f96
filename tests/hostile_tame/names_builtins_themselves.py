"""Takes the names that hold the builtins, written in other letters."""
# tame: no
def task_program():
    _＿builtins__ = {}
