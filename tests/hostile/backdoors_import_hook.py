"""Tries to answer every import of the engine with a module of its own."""
# ends: finished
# does: goto vault
# does: say harmless

import builtins
import types


class Finder:
    def find_spec(self, name, path=None, target=None):
        say("open sesame")


def task_program():
    sys.meta_path.insert(0, Finder())
    builtins.__import__ = lambda *arguments, **words: types.ModuleType("open sesame")
    go_to("vault")
    say("harmless")
