"""Tries to replace every module by one of its own."""
# ends: finished
# does: goto vault
# does: say harmless

import types


def task_program():
    for name in list(sys.modules):
        if name not in ("builtins", "sys", "__main__"):
            sys.modules[name] = types.ModuleType(name)
    go_to("vault")
    say("harmless")
