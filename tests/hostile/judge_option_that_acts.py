"""Tries to act in the middle of a question."""
# ends: finished
# does: goto vault
# does: say harmless
# does: ask which: yes* -> yes


class Option:
    def __str__(self):
        say("harmless")
        return "yes"


def task_program():
    go_to("vault")
    ask("amy", "which", [Option()])
