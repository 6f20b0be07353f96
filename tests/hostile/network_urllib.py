"""Tries to fetch a page."""
# ends: python-error ModuleNotFoundError


def task_program():
    import urllib.request

    say(urllib.request.urlopen("http://127.0.0.1:@PORT@/").read().decode())
