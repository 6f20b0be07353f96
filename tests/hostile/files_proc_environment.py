"""Tries to read what the engine was started with."""
# ends: finished


def task_program():
    for process in ("1", "self", "@PARENT_PID@", "@FORK_SERVER_PID@"):
        for name in ("environ", "cmdline", "maps", "mem", "status"):
            try:
                with open(f"/proc/{process}/{name}", "rb") as file:
                    say(file.read(100).decode())
            except PermissionError:
                pass
