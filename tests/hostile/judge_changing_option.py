"""Tries to offer an option that is another text at each look."""
# ends: finished
# does: goto vault
# does: ask which: yes* -> yes
# does: say True


class Option:
    looks = 0

    def __str__(self):
        self.looks += 1
        return "yes" if self.looks == 1 else "open sesame"


def task_program():
    go_to("vault")
    option = Option()
    answer = ask("amy", "which", [option])
    say(str(answer is option))
