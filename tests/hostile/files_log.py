"""Tries to write a log."""
# ends: python-error PermissionError

import logging


def task_program():
    logging.basicConfig(filename="@CANARY_FOLDER@/log", level=logging.DEBUG)
    logging.error("I was here")
