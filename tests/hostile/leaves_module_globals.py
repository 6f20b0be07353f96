"""Tries to leave changed modules to the next run."""
# ends: finished

import json
import random
import string


def task_program():
    json.I_WAS_HERE = random.I_WAS_HERE = True
    json.JSONEncoder.item_separator = " I was here "
    string.ascii_lowercase = "I was here"
    random.seed(7)
    random.random = lambda: 7.0
    sys.modules["i_was_here"] = json
    time.sleep(100)
