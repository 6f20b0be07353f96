"""Rules for programs that may share a process, each with a program that keeps it and one that breaks it."""

import ast
import json
import os
import signal
import sys
import warnings
from pathlib import Path

import pytest

from codebotler.core.skills.paper import SKILLS
from codebotler.core.trace import Outcome, Status
from codebotler.core.world import Room, World
from codebotler.simulator.process.compiler import (
    LONG_SOURCE,
    CompiledProgram,
    compile_program,
    compile_programs,
)
from codebotler.simulator.process.isolated_call import IDLE_PROCESSES
from codebotler.simulator.sandbox import tame
from codebotler.simulator.sandbox.fuel import nodes_of
from codebotler.simulator.sandbox.tame import GIVEN
from codebotler.simulator.settings import Limits, SimulationSettings
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.robot import SimulatedRobot
from in_process import all_of

NAMES = frozenset(SKILLS)
WORLD = World((Room("hall"),), "hall")

# Each rule has the smallest program that keeps it, and the smallest one that breaks only this rule.
RULES = [
    # --- names that are bound
    ("a function's name has no two underscores first", "def _f(): pass", "def __f(): pass"),
    ("nor has a parameter's", "def f(_a): pass", "def f(__a): pass"),
    ("nor has a variable's, also one that may be read", "x = 1", "__name__ = 1"),
    (
        "nor has that of a caught error",
        "try: pass\nexcept: pass",
        "try: pass\nexcept OSError as __name__: pass",
    ),
    ("a function's name is bound by nothing else", "def f(): pass\nf()", "def f(): pass\ndef g(f): pass"),
    ("no function is named like a skill", "def f(): pass", "def say(): pass"),
    ("nor like a builtin of tame programs", "def f(): pass", "def print(): pass"),
    ("nor like another builtin", "def f(): pass", "def open(): pass"),
    ("nor like what the interpreter adds", "def f(): pass", "def exit(): pass"),
    ("nor like a module that is there", "def f(): pass", "def sys(): pass"),
    ("nor like the clock", "def f(): pass", "def time(): pass"),
    # --- names that stand for data
    ("a function is no data", "def f(): pass\nx = f()", "def f(): pass\nx = f"),
    ("a skill is no data", "x = say('a')", "x = say"),
    ("a builtin is no data", "x = len('a')", "x = len"),
    ("an iterator's name is no data", "x = list(zip('a'))", "x = zip"),
    ("an error's name is no data", "raise ValueError", "x = ValueError"),
    ("nor is the name of what only others find", "x = y", "x = open"),
    ("nor is that of the interpreter's own", "x = y", "x = quit"),
    ("nor is a module", "x = y", "x = sys"),
    ("nor is the clock", "x = time.time()", "x = time"),
    ("nothing with two underscores is read", "x = _builtins", "x = __builtins__"),
    ("but the name of the module is", "x = __name__", "x = __spec__"),
    ("nobody rebinds a builtin in the module", "numbers = [1]", "list = [1]"),
    ("nobody rebinds a skill in the module", "speak = 1", "say = 1"),
    ("nobody deletes one", "del x", "del len"),
    # --- names that hide others in a function
    ("a parameter hides a builtin", "def f(len): return len", "def f(a): return len"),
    ("a parameter hides what only others find", "def f(open): return open", "def f(a): return open"),
    ("a parameter by position does", "def f(len, /): return len", "def f(a, /): return len"),
    ("a parameter by keyword does", "def f(*, len): return len", "def f(*, a): return len"),
    ("a parameter of several does", "def f(*len): return len", "def f(*a): return len"),
    ("a parameter of further ones does", "def f(**len): return len", "def f(**a): return len"),
    ("a variable does", "def f():\n    len = 1\n    return len", "def f():\n    a = 1\n    return len"),
    (
        "a variable of a block does",
        "def f():\n    for len in 'a': pass\n    return len",
        "def f():\n    for a in 'a': pass\n    return len",
    ),
    (
        "a caught error does",
        "def f():\n    try: pass\n    except OSError as len: x = len",
        "def f():\n    try: pass\n    except OSError as a: x = len",
    ),
    (
        "also in functions within",
        "def f(len):\n    def g(): return len",
        "def f(a):\n    def g(): return len",
    ),
    (
        "but not what a function within binds",
        "def f():\n    def g(len): return len",
        "def f():\n    def g(len): pass\n    return len",
    ),
    (
        "nor what a function within assigns",
        "def f():\n    def g():\n        len = 1\n        return len",
        "def f():\n    def g():\n        len = 1\n    return len",
    ),
    ("nor after the function", "def f(len): x = len", "def f(len): pass\nx = len"),
    ("nor in its defaults", "def f(len, a=len('a')): pass", "def f(len, a=len): pass"),
    ("a hidden skill is data", "def f(say): x = say", "def f(a): x = say"),
    ("a hidden clock is data", "def f(time): x = time", "def f(a): x = time"),
    ("what hides the clock has its methods no more", "def f(a): time.sleep(1)", "def f(time): time.sleep(1)"),
    ("a hidden consumer consumes nothing", "def f(a): list(zip(a))", "def f(list): list(zip([]))"),
    ("a hidden iterator is none", "def f(a): list(zip(a))", "def f(zip): list(zip(x for x in 'a'))"),
    (
        "a hidden error is none",
        "def f(a): raise OSError(1)",
        "def f(OSError):\n    try: pass\n    except OSError: pass",
    ),
    # --- statements
    ("an expression has parts", "1 + 1", "1 + print"),
    ("an assignment has a target", "x[0] = 1", "x.y = 1"),
    ("an assignment has a value", "x = 1", "x = b''"),
    ("an addition has a target", "x[0] += 1", "x.y += 1"),
    ("an addition has a value", "x += 1", "x += b''"),
    ("a loop has a condition", "while x: pass", "while b'': pass"),
    ("a loop has statements", "while x: pass", "while x: import os"),
    ("a loop has an else", "while x: pass\nelse: pass", "while x: pass\nelse: import os"),
    ("a choice has a condition", "if x: pass", "if b'': pass"),
    ("a choice has statements", "if x: pass", "if x: import os"),
    ("a choice has an else", "if x: pass\nelse: pass", "if x: pass\nelse: import os"),
    ("a function returns data", "def f(): return x", "def f(): return b''"),
    ("a function may return nothing", "def f(): return", "def f(): return zip"),
    ("an assertion has a condition", "assert x", "assert b''"),
    ("an assertion has a message", "assert x, 'a'", "assert x, b''"),
    ("what is deleted is data", "del x[0]", "del x.y"),
    ("a loop may be left", "while x: break", "while x: await y"),
    ("a loop may go on", "while x: continue", "while x: yield"),
    ("there are no classes", "def f(): pass", "class A: pass"),
    ("nothing is awaited", "def f(): pass", "async def f(): pass"),
    ("nothing is managed", "x", "with x: pass"),
    ("nothing is matched", "if x: pass", "match x:\n    case 1: pass"),
    ("no groups of errors are caught", "try: pass\nexcept OSError: pass", "try: pass\nexcept* OSError: pass"),
    ("nothing is imported from a module", "import time", "from time import time"),
    # --- functions
    ("a function has no decorator", "def f(): pass", "@g\ndef f(): pass"),
    ("a function returns what is annotated", "def f() -> int: pass", "def f() -> open: pass"),
    ("a default is data", "def f(a=1): pass", "def f(a=b''): pass"),
    ("a default of a keyword is data", "def f(*, a=1, b): pass", "def f(*, a=b''): pass"),
    ("a parameter is annotated", "def f(a: int): pass", "def f(a: open): pass"),
    ("one by position is", "def f(a: int, /): pass", "def f(a: open, /): pass"),
    ("one by keyword is", "def f(*, a: int): pass", "def f(*, a: open): pass"),
    ("one of several is", "def f(*a: int): pass", "def f(*a: open): pass"),
    ("one of further ones is", "def f(**a: int): pass", "def f(**a: open): pass"),
    ("a function has statements", "def f(): x", "def f(): import os"),
    # --- annotations
    ("an annotation may be None", "x: None", "x: -1"),
    ("an annotation may be a string", "x: 'a'", "x: f'{x}'"),
    ("an annotation may be a type of data", "x: int", "x: set"),
    ("an annotation has a head", "x: list[int]", "x: set[int]"),
    ("an annotation has arguments", "x: list[int]", "x: list[set]"),
    ("an annotation has several arguments", "x: dict[str, int]", "x: dict[str, set]"),
    ("an annotation has a left side", "x: str | int", "x: set | int"),
    ("an annotation has a right side", "x: int | None", "x: int | set"),
    ("an annotation has no other operators", "x: int | str", "x: int & str"),
    ("an annotation calls nothing", "x: int", "x: int()"),
    ("what is annotated is data", "x[0]: int = 1", "x.y: int = 1"),
    ("what is annotated has a value", "x: int = 1", "x: int = b''"),
    # --- declarations
    ("variables are declared global", "def f():\n    global x", "def f():\n    global len"),
    ("no function is", "def f():\n    global x", "def f():\n    global f"),
    ("no skill is", "def f():\n    global x", "def f():\n    global say"),
    ("nothing that others find is", "def f():\n    global x", "def f():\n    global open"),
    ("nothing with two underscores is", "def f():\n    global _x", "def f():\n    global __name__"),
    (
        "variables are declared nonlocal",
        "def f(x):\n    def g():\n        nonlocal x",
        "def f(len):\n    def g():\n        nonlocal len",
    ),
    # --- imports
    ("the clock is imported", "import time", "import sys"),
    ("it is imported alone", "import time, time", "import time, os"),
    ("it keeps its name", "import time as time", "import time as t"),
    ("it is not imported as something else", "import time", "import os as time"),
    ("it is imported where it is the clock", "def f(): import time", "def f(time): import time"),
    # --- loops
    ("a loop has a target", "for x[0] in 'a': pass", "for x.y in 'a': pass"),
    ("a loop goes through data", "for x in 'a': pass", "for x in b'': pass"),
    ("a loop consumes an iterator", "for x in zip('a'): pass", "for x in iter('a'): pass"),
    ("a loop runs statements", "for x in 'a': pass", "for x in 'a': import os"),
    ("a loop ends with statements", "for x in 'a': pass\nelse: pass", "for x in 'a': pass\nelse: import os"),
    # --- errors
    ("an attempt has statements", "try: x\nfinally: pass", "try: import os\nfinally: pass"),
    ("an attempt has handlers", "try: pass\nexcept: pass", "try: pass\nexcept: import os"),
    (
        "an attempt has an else",
        "try: pass\nexcept: pass\nelse: pass",
        "try: pass\nexcept: pass\nelse: import os",
    ),
    ("an attempt has an end", "try: pass\nfinally: pass", "try: pass\nfinally: import os"),
    (
        "a caught error is no builtin",
        "try: pass\nexcept OSError as e: pass",
        "try: pass\nexcept OSError as len: pass",
    ),
    ("what is caught is an error", "try: pass\nexcept OSError: pass", "try: pass\nexcept SystemExit: pass"),
    ("what is caught has a name", "try: pass\nexcept OSError: pass", "try: pass\nexcept f(): pass"),
    (
        "all that is caught are errors",
        "try: pass\nexcept (OSError, KeyError): pass",
        "try: pass\nexcept (OSError, len): pass",
    ),
    ("what is caught is no variable", "try: pass\nexcept OSError: pass", "try: pass\nexcept x: pass"),
    ("an error is raised", "raise ValueError", "raise SystemExit"),
    ("an error is raised with data", "raise ValueError(1)", "raise ValueError(b'')"),
    ("an error is raised with keywords", "raise ValueError(a=1)", "raise ValueError(a=b'')"),
    ("an error is raised from data", "raise ValueError from x", "raise ValueError from b''"),
    (
        "an error is raised from an error",
        "raise ValueError from OSError(1)",
        "raise ValueError from SystemExit(1)",
    ),
    ("a caught error is raised again", "try: pass\nexcept OSError as e: raise e", "raise time"),
    ("an error is no result", "raise ValueError(1)", "x = ValueError(1)"),
    # --- iterating on the spot
    ("a generator is consumed", "any(x for x in 'a')", "y = (x for x in 'a')"),
    ("a map is consumed", "list(map(str, 'a'))", "x = map(str, 'a')"),
    ("a map of nothing is consumed", "list(map())", "x = map()"),
    ("an iterator has data", "list(zip('a', 'b'))", "list(zip('a', b''))"),
    ("an iterator has iterators", "list(zip(map(str, 'a')))", "list(zip(iter('a')))"),
    ("an iterator has several arguments", "list(zip(*x))", "list(zip(*b''))"),
    ("an iterator has keywords", "list(zip(x, strict=True))", "list(zip(x, strict=b''))"),
    ("an iterator calls no keyword", "list(enumerate('a', start=1))", "list(enumerate('a', start=len))"),
    ("only a map and a filter call something", "list(map(len, 'a'))", "list(zip(len, 'a'))"),
    ("a filter calls something", "list(filter(len, 'a'))", "list(reversed(len, 'a'))"),
    ("a view is consumed", "list(x.items())", "y = x.items()"),
    ("a view is one of data", "list(x.items())", "list(sys.items())"),
    ("a view takes nothing", "list(x.keys())", "list(x.keys(1))"),
    ("a view takes nothing by keyword", "list(x.keys())", "list(x.keys(a=1))"),
    ("only views are", "list(x.values())", "list(x.splits())"),
    ("a consumer consumes its first argument only", "sum(zip('a'), 1)", "sum([], zip('a'))"),
    ("other builtins do not", "sum(zip('a'))", "str(zip('a'))"),
    ("to show an iterator shows its address", "print(list(zip('a')))", "print(zip('a'))"),
    ("the largest of several is one of them", "max(zip('a'))", "max(zip('a'), 'b')"),
    ("the least of several is one of them", "min(zip('a'))", "min(zip('a'), 'b')"),
    ("a method that consumes does", "x.extend(zip('a'))", "x.append(zip('a'))"),
    ("a method consumes its first argument only", "x.join(zip('a'))", "x.join('a', zip('a'))"),
    ("several arguments are consumed", "f(*zip('a'))", "f(zip('a'))"),
    ("several elements are consumed", "x = [*zip('a')]", "x = [zip('a')]"),
    ("several elements of a tuple are", "x = (*zip('a'),)", "x = (zip('a'),)"),
    ("further keywords are not", "f(**x)", "f(**zip('a'))"),
    ("a search consumes", "1 in zip('a')", "1 == zip('a')"),
    ("a search in vain consumes", "1 not in zip('a')", "zip('a') not in x"),
    ("what a comprehension goes through is consumed", "[x for x in zip('a')]", "[zip('a') for x in 'a']"),
    ("nothing is unpacked but what is data", "a, *b = x", "a, *b.c = x"),
    ("an assignment consumes nothing", "a, b = x", "a, b = zip('a')"),
    # --- callbacks
    ("a function is called on the spot", "def f(x): pass\nlist(map(f, 'a'))", "list(map(open, 'a'))"),
    ("a skill is", "list(map(say, 'a'))", "list(map(exit, 'a'))"),
    ("a builtin is", "list(map(len, 'a'))", "list(map(zip, 'a'))"),
    ("none that would give away an iterator is", "list(map(sum, 'a'))", "list(map(next, 'a'))"),
    ("an error is none", "list(map(str, 'a'))", "list(map(ValueError, 'a'))"),
    ("nothing may be", "list(filter(None, 'a'))", "list(filter(b'', 'a'))"),
    ("a lambda is", "list(map(lambda a: a, 'a'))", "x = lambda a: a"),
    ("a lambda gives data", "list(map(lambda a: a, 'a'))", "list(map(lambda a: len, 'a'))"),
    ("a lambda has defaults", "list(map(lambda a, b=1: a, 'a'))", "list(map(lambda a, b=b'': a, 'a'))"),
    ("a lambda hides nothing", "list(map(lambda a: a, 'a'))", "list(map(lambda len: 1, 'a'))"),
    ("a lambda hides no skill", "list(map(lambda a: a, 'a'))", "def f(say): list(map(lambda say: 1, 'a'))"),
    (
        "a lambda hides nothing that others find",
        "list(map(lambda a: a, 'a'))",
        "list(map(lambda open: 1, 'a'))",
    ),
    ("the largest has a key", "max('a', key=len)", "max('a', default=len)"),
    ("the least has a key", "min('a', key=len)", "min('a', key=zip)"),
    ("what is sorted has a key", "sorted('a', key=len)", "sorted('a', reverse=len)"),
    ("a list that is sorted has a key", "x.sort(key=len)", "x.sort(reverse=len)"),
    ("what is added up has none", "sum('a', start=1)", "sum('a', key=len)"),
    ("a list that is extended has none", "x.extend('a')", "x.extend('a', key=len)"),
    # --- calls
    ("a function has arguments", "def f(a): pass\nf(1)", "def f(a): pass\nf(b'')"),
    ("a function has keywords", "def f(a): pass\nf(a=1)", "def f(a): pass\nf(a=b'')"),
    ("a function calls no keyword", "def f(key): pass\nf(key=1)", "def f(key): pass\nf(key=len)"),
    ("a skill has arguments", "say('a')", "say(b'')"),
    ("data has arguments", "x(1)", "x(b'')"),
    ("a builtin has arguments", "abs(1)", "abs(b'')"),
    ("a builtin has further arguments", "pow(1, 1)", "pow(1, b'')"),
    ("a builtin has keywords", "round(1, ndigits=1)", "round(1, ndigits=b'')"),
    ("a builtin has several arguments", "print(*x)", "print(*b'')"),
    ("a consumer has several arguments", "sum(*x)", "sum(*b'')"),
    ("only some builtins are called", "len('a')", "vars()"),
    ("an iterator is no result", "list(zip())", "zip()"),
    ("the clock is read", "time.time()", "time.get_clock_info('time')"),
    ("the clock has arguments", "time.sleep(1)", "time.sleep(b'')"),
    ("the clock has keywords", "time.sleep(a=1)", "time.sleep(a=b'')"),
    ("fields are filled", "'{}'.format(1)", "'{}'.format(b'')"),
    ("fields by name are filled", "'{a}'.format(a=1)", "'{a}'.format(a=b'')"),
    ("fields have no attributes", "'{0}'.format(1)", "'{0.real}'.format(1)"),
    ("fields have no elements", "'{a}'.format(a=1)", "'{a[0]}'.format(a=1)"),
    ("fields have no fields", "'{:>3}'.format(1)", "'{:>{}}'.format(1, 2)"),
    ("fields are shown in one of three ways", "'{!r} {!s:>3} {!a}'.format(1, 2, 3)", "'{!x}'.format(1)"),
    ("what is no field is none", "'{{a.b}} {}'.format(1)", "'{{{a.b}}}'.format(1)"),
    ("fields are those of a constant", "'{}'.format(1)", "x.format(1)"),
    ("a method is one of data", "x.pop()", "sys.pop()"),
    ("a method has arguments", "x.pop(1)", "x.pop(b'')"),
    ("a method has keywords", "x.split(sep='a')", "x.split(sep=b'')"),
    ("a method calls no keyword", "x.split(sep='a')", "x.split(key=len)"),
    ("a method is called where it is named", "x.pop()", "x.pop"),
    ("a method of the clock is, too", "time.time()", "x = time.time"),
    ("only what has a name is called", "x()", "x()()"),
    ("an element is not called", "x[0]", "x[0]()"),
    ("a lambda is not called", "x()", "(lambda: 1)()"),
    # --- other expressions
    ("constants are data", "x = 'a', 1, 1.5, None, True, ...", "x = 1j"),
    ("bytes are none", "x = 'a'", "x = b'a'"),
    ("sets are none", "x = {1: 1}", "x = {1}"),
    ("sets are none, also where one is drawn up", "x = {y: 1 for y in 'a'}", "x = {y for y in 'a'}"),
    ("elements of lists are data", "x = [1]", "x = [b'']"),
    ("elements of tuples are data", "x = (1,)", "x = (b'',)"),
    ("keys are data", "x = {1: 1}", "x = {b'': 1}"),
    ("values are data", "x = {1: 1, **y}", "x = {1: b''}"),
    ("both sides of `and` are data", "x and y", "x and b''"),
    ("both sides of an operator are data", "x % y", "x % b''"),
    ("what has one side is data", "not x", "not b''"),
    ("what is chosen is data", "x if y else z", "x if y else b''"),
    ("what is indexed is data", "x[1]", "sys[1]"),
    ("indices are data", "x[1]", "x[b'']"),
    ("slices are data", "x[1:2:3]", "x[1:b'']"),
    ("fields of a string are data", "f'{x}'", "f'{len}'"),
    ("formats of a string are data", "f'{x:>{y}}'", "f'{x:>{len}}'"),
    ("`is` compares with None", "x is None", "x is 1"),
    ("`is` compares None with it", "None is x", "'a' is x"),
    ("`is not` compares with True", "x is not True", "x is not y"),
    ("`is` compares with False", "x is False", "x is ()"),
    ("each `is` does", "x is None is y", "x is None == y is z"),
    ("the first side is data", "x == y", "b'' == y"),
    ("each side is data", "x < y < z", "x < y < b''"),
    ("a searched one is data", "x in y", "x in b''"),
    ("a comprehension has variables", "[x for x in 'a']", "[1 for x.y in 'a']"),
    ("a comprehension hides no builtin", "[x for x in 'a']", "def f(len): return [1 for len in 'a']"),
    ("a comprehension hides no skill", "[x for x in 'a']", "def f(say): return [1 for say in 'a']"),
    (
        "a comprehension hides nothing that others find",
        "[x for x, y in 'a']",
        "def f(open): return [1 for x, open in 'a']",
    ),
    ("a comprehension goes through data", "[x for x in 'a']", "[x for x in b'']"),
    (
        "a comprehension goes through several",
        "[x for x in 'a' for y in 'b']",
        "[x for x in 'a' for y in b'']",
    ),
    ("a comprehension has conditions", "[x for x in 'a' if x]", "[x for x in 'a' if b'']"),
    ("a comprehension waits for nothing", "[x for x in 'a']", "[x async for x in 'a']"),
    ("a comprehension has elements", "[x for x in 'a']", "[b'' for x in 'a']"),
    ("a comprehension has keys", "{x: 1 for x in 'a'}", "{b'': 1 for x in 'a'}"),
    ("a comprehension has values", "{x: 1 for x in 'a'}", "{x: b'' for x in 'a'}"),
    ("a generator has elements", "any(x for x in 'a')", "any(b'' for x in 'a')"),
    ("nothing is yielded", "def f(): x", "def f(): yield"),
    ("nothing is yielded from", "def f(): x", "def f(): yield from x"),
]
NEW_IN_312 = [
    ("a function has no parameters of types", "def f(): pass", "def f[T](): pass"),
    ("no types are named", "x = 1", "type x = int"),
]
RULES += NEW_IN_312 * (sys.version_info >= (3, 12))

# All names that a tame program may use, by the code around them.
CALLS = """
all any dict len list max min next sorted sum tuple abs bool chr divmod float int ord pow print range repr
"""
PLACES = {
    "{}(x)": f"{CALLS} round str",
    "list({}(x))": "enumerate filter map reversed zip",
    "list(map({}, x))": CALLS.replace(" next ", " ") + " round str",
    "x: {}": "bool dict float int list str tuple",
    "raise {}": """
        ArithmeticError AssertionError AttributeError BaseException EOFError Exception IndexError KeyError
        LookupError MemoryError NameError NotImplementedError OSError OverflowError RecursionError
        RuntimeError StopIteration TimeoutError TypeError UnboundLocalError ValueError ZeroDivisionError
    """,
    "{}(zip(x))": "all any dict len list max min next sorted sum tuple",
    "x.{}()": """
        capitalize casefold center count endswith expandtabs find index isalnum isalpha isdecimal isdigit
        islower isnumeric isspace istitle isupper join ljust lower lstrip partition removeprefix removesuffix
        replace rfind rindex rjust rpartition rsplit rstrip split splitlines startswith strip swapcase title
        upper zfill
    """,
    "x.{}(1)": """
        append clear copy extend get insert pop popitem remove reverse setdefault sort update lower join
    """,
    "x.{}(zip(x))": "extend join update",
    "list(x.{}())": "items keys values",
    "time.{}()": "asctime ctime gmtime localtime monotonic perf_counter sleep strftime time",
}
SPOTS = tuple(place for place in PLACES if "." not in place)  # places for names that are not methods

# These names reveal an address, or the earlier work of the process.
REVEALING_NAMES = """
aiter anext ascii breakpoint bytearray bytes callable classmethod compile complex copyright credits
delattr dir eval exec exit format frozenset getattr globals hasattr hash help hex id input issubclass iter
license locals memoryview object oct open property quit set setattr slice staticmethod super sys type vars
ExceptionGroup GeneratorExit ImportError KeyboardInterrupt SystemExit __build_class__ __debug__ __import__
"""
METHODS = """
add add_note as_integer_ratio bit_length cast close decode difference encode format format_map fromkeys
hex intersection isidentifier isprintable items keys maketrans send throw to_bytes tobytes translate union
values with_traceback __class__ __dict__ __format__ __getitem__ __init__ __iter__ __next__
"""


def is_tame(source: str) -> bool:
    with warnings.catch_warnings(action="ignore"):  # some programs compare numbers by `is`
        tree = ast.parse(source)
    return tame.is_tame(tree, nodes_of(tree), NAMES)


@pytest.mark.parametrize(("keeps", "breaks"), [rule[1:] for rule in RULES], ids=[rule[0] for rule in RULES])
def test_program_is_tame_if_it_keeps_the_rule_and_wild_if_it_breaks_it(keeps: str, breaks: str) -> None:
    assert is_tame(keeps)
    assert not is_tame(breaks)


@pytest.mark.parametrize("place", PLACES)
def test_tame_program_may_use_every_allowed_name(place: str) -> None:
    assert [name for name in PLACES[place].split() if not is_tame(place.format(name))] == []


@pytest.mark.parametrize(
    "place", [*SPOTS, "x = {}", "{}.time()", "def f(): global {}", "{} = 1", "f({}=1, a={})", "{}(zip(x), x)"]
)
def test_program_with_a_revealing_name_is_wild(place: str) -> None:
    assert [name for name in REVEALING_NAMES.split() if is_tame(place.format(name, name))] == []


@pytest.mark.parametrize(
    "program", ["x.{}()", "x.{}", "'a'.{}(1)", "list(map(x.{}, 'a'))", "list(map(str.{}, 'a'))", "time.{}()"]
)
def test_methods_that_return_more_than_data_are_wild(program: str) -> None:
    assert {method for method in METHODS.split() if is_tame(program.format(method))} <= {"format"}


def test_too_deeply_nested_program_is_wild() -> None:
    tree = ast.Module([ast.Expr(ast.Constant(1))], [])
    for _ in range(5_000):
        tree.body = [ast.If(ast.Constant(1), tree.body, [])]
    assert not tame.is_tame(tree, {}, NAMES)


def test_name_of_an_added_skill_is_not_data() -> None:
    tree = ast.parse("x = wave\nwave(x)")
    assert tame.is_tame(tree, nodes_of(tree), NAMES)  # without a skill `wave`, the name is like any other
    assert not tame.is_tame(tree, nodes_of(tree), NAMES | {"wave"})


# --- names

LISTS_ALL_NAMES = """
def task_program():
    for name in sorted({*globals(), *dir(__builtins__)}):
        say(name)
"""
USES_ONE = """
    try:
        say('{0} ' + str({1}))
    except BaseException as error:
        say('{0} ' + str(error))
"""


def names_of_ordinary_programs() -> list[str]:
    """Return all names that a program in a process of its own finds at its start."""
    worker = Worker(one_process_per_run=True)
    try:
        outcome = worker.run(
            LISTS_ALL_NAMES, lambda: SimulatedRobot(WORLD, SimulationSettings(literals="as-written"))
        )
    finally:
        worker.close()
    assert outcome.status is Status.FINISHED
    return [event.text for event in outcome.trace]


def test_every_name_of_ordinary_programs_is_allowed_or_wild() -> None:
    names = names_of_ordinary_programs()
    assert {"say", "print", "exit", "sys", "time", "open", "__name__", "__spec__"} < set(names)
    allowed = NAMES | GIVEN | {"time", "__name__"}
    places = [*SPOTS, "x = {}", "{}.time()", "say({})", "f(*{})", "try: pass\nexcept {}: pass", "raise {}(1)"]
    own = {"None", "True", "False", "task_program"}
    for name in (name for name in names if name.isidentifier() and name not in own):
        if name not in allowed:
            assert [place for place in places if is_tame(place.format(name))] == []
        elif name != "__name__":
            assert not is_tame(f"x = {name}")


def test_compiler_knows_names_that_its_own_interpreter_lacks() -> None:
    for program, is_wild in (
        ("x = exit", True),
        ("x = quit", True),
        ("def quit(): pass", True),
        ("x = y", False),
    ):
        compiled = compile_program(program, "lowercase", tuple(NAMES))
        assert isinstance(compiled, CompiledProgram)
        assert compiled.is_tame is not is_wild


def test_programs_compiled_together_and_alone_are_equal() -> None:
    deep = "x = " + "[" * 3_000 + "]" * 3_000
    programs = ["say('Hi')", "import os", "x = (", deep, "\ud800", "go_to('lab')\n" * 3_000, "say('Ho')"]
    skills = tuple(NAMES)
    alone = [compile_program(program, "lowercase", skills) for program in programs]
    compile_program.cache_clear()
    assert compile_programs(programs, "lowercase", skills) == alone
    with_long = [*programs, f"'{'x' * LONG_SOURCE}'"]
    together = compile_programs(with_long, "lowercase", skills)
    assert together[:-1] == alone
    assert isinstance(together[-1], CompiledProgram)


@pytest.mark.slow
def test_program_that_exhausts_the_compiler_does_not_affect_the_others() -> None:
    greedy = f"import {'.'.join(['a'] * 40_000)}\n"
    first, refused, last = compile_programs(["say(1)", greedy, "say(2)"], "lowercase", ("say",))
    assert isinstance(first, CompiledProgram)
    assert isinstance(last, CompiledProgram)
    assert isinstance(refused, Outcome)
    assert refused.error is not None
    assert refused.error.kind in {"MemoryError", "TimeoutError", "Crash"}


@pytest.mark.parametrize("number", [signal.SIGXCPU, signal.SIGSYS, signal.SIGSEGV])
def test_killed_compiler_is_replaced_for_several_programs(number: int) -> None:
    compile_programs(["say(0)", "say(1)"], "lowercase", ("say",))
    os.kill(IDLE_PROCESSES["codebotler.simulator.process.compiler"][-1]._process.pid, number)
    together = compile_programs(["say(1)", "say(2)"], "lowercase", ("say",))
    assert [type(one) for one in together] == [CompiledProgram, CompiledProgram]


def test_tame_programs_find_every_allowed_name() -> None:
    uses = {name: f"{name}()" for name in PLACES["{}(x)"].split()}
    uses |= {name: f"list({name}())" for name in PLACES["list({}(x))"].split()}
    uses |= {"__name__": "__name__"}
    uses |= {f"time.{name}": f"time.{name}()" for name in PLACES["time.{}()"].split()}
    errors = [name for name in PLACES["raise {}"].split() if name not in {"MemoryError", "RecursionError"}]
    uses |= {name: f"f('{name}')" for name in errors}
    raising = "".join(f"    if name == '{name}': raise {name}(name)\n" for name in errors)
    tried = "".join(USES_ONE.format(*use) for use in uses.items())
    program = f"import time\ndef f(name):\n{raising}def task_program():\n{tried}"
    settings = SimulationSettings(literals="as-written", limits=Limits(ticks=10_000))
    worker = Worker()
    try:
        known = worker.run_tame([(program, [lambda: SimulatedRobot(WORLD, settings)])])
        assert all_of(known[0, 0]) == all_of(
            worker.run_alone(program, lambda: SimulatedRobot(WORLD, settings))
        )
    finally:
        worker.close()
    texts = [event.text for event in known[0, 0].trace]
    assert [text.partition(" ")[0] for text in texts] == list(uses)
    assert [text for text in texts if "is not defined" in text] == []


# --- real programs


@pytest.mark.slow
def test_all_real_programs_that_parse_are_tame(corpus: Path) -> None:
    wild = []
    parsed = 0
    for line in (corpus / "corpus" / "programs.jsonl").read_text(encoding="utf-8").splitlines():
        program = json.loads(line)["program"]
        try:
            with warnings.catch_warnings(action="ignore"):
                ast.parse(program)
        except (SyntaxError, ValueError):
            continue
        parsed += 1
        if not is_tame(program):
            wild.append(program)
    assert wild == []
    assert parsed > 900
