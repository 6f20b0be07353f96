"""Tries to import a module that holds a secret."""
# ends: python-error ModuleNotFoundError

sys.path.insert(0, "@SECRET_FOLDER@")


def task_program():
    import hushed

    say(hushed.SECRET)
