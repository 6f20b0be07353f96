"""Tries to have truth values and numbers taken for texts."""
# ends: robot-error AskInvalidOptions
# does: goto vault
# does: ask which: True*, 1*, 2.5*


def task_program():
    go_to("vault")
    ask("amy", "which", [True, 1, 2.5])
