"""Tries to speak when everything is over, from a function to be called at exit."""
# ends: finished

import logging


def task_program():
    logging.atexit.register(say, "open sesame")
