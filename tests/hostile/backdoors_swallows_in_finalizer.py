"""Tries to spend its budget where exceptions are forgotten."""
# ends: timeout TimeoutError


class Spender:
    def __del__(self):
        while True:
            pass


def task_program():
    Spender()
    go_to("vault")
    say("open sesame")
