"""Tries to pass by saying patterns that fit everything."""
# ends: finished
# does: goto vault
# does: say .*
# does: say open|sesame
# does: say \\w+ \\w+


def task_program():
    go_to("vault")
    for text in (".*", "open|sesame", "\\w+ \\w+"):
        say(text)
