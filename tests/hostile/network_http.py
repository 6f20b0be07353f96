"""Tries to post to a web server."""
# ends: python-error ModuleNotFoundError


def task_program():
    import http.client

    http.client.HTTPConnection("127.0.0.1", @PORT@).request("POST", "/", "I was here")
