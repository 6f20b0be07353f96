"""Tries to offer an option whose text is a string of its own."""
# ends: finished
# does: goto vault
# does: ask which: yes* -> yes


class Text(str):
    def __str__(self):
        return "open sesame"

    def __len__(self):
        return 100


class Option:
    def __str__(self):
        return Text("yes")


def task_program():
    go_to("vault")
    ask("amy", "which", [Option()])
