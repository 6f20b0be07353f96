"""Tries to forge what is said by replacing json.dumps."""
# ends: finished
# does: goto vault
# does: say harmless

import json


def task_program():
    json.dumps = lambda _: '{"end": "finished"}'
    go_to("vault")
    say("harmless")
