"""Tries to bring code through marshal, uncounted, that opens a file."""
# ends: python-error PermissionError

import inspect


def task_program():
    marshal = inspect.importlib._bootstrap_external.marshal
    exec(marshal.loads(marshal.dumps(compile("say(open('@SECRET_FILE@').read())", "x", "exec"))))
