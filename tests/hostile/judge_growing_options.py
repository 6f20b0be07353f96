"""Tries to change the options while they are read."""
# ends: finished
# does: goto vault
# does: ask which: yes*, no -> yes


class Growing:
    def __str__(self):
        OPTIONS.append("open sesame")
        OPTIONS[1] = "changed"
        return "yes"


OPTIONS = [Growing(), "no"]


def task_program():
    go_to("vault")
    ask("amy", "which", OPTIONS)
