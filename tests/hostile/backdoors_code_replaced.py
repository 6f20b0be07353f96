"""Tries to cut the counting out of its own code and to loop more often than it may."""
# ends: finished


def loop():
    for _ in range(300_000):
        pass


def task_program():
    names = tuple("int" if name.startswith("<") else name for name in loop.__code__.co_names)
    loop.__code__ = loop.__code__.replace(co_names=names)
    loop()
