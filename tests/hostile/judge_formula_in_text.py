"""Tries to break out of the requirement by saying one."""
# ends: finished
# does: goto vault
# does: say ")) or tr.Exists(say(".*


def task_program():
    go_to("vault")
    say('")) or tr.Exists(say(".*')
