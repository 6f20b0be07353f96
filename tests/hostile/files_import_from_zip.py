"""Tries to import a module that holds a secret from a zip."""
# ends: python-error ModuleNotFoundError

sys.path.insert(0, "@SECRET_FOLDER@/hushed.zip")


def task_program():
    import zipped

    say(zipped.SECRET)
