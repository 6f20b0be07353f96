"""Tries to end in an error of syntax whose fields fail."""
# ends: python-error Wrong


class Wrong(SyntaxError):
    filename = "<program>"
    msg = property(lambda self: 1 / 0)
    lineno = property(lambda self: 1 / 0)


def task_program():
    exec(compile("raise error", "x", "exec"), {"error": Wrong("x")})
