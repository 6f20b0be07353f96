"""Programs find the documented environment, and no way out of it."""

import textwrap
from typing import TypeAlias

import pytest

from codebotler.core.trace import Event, Option, Outcome, RunError, Status
from codebotler.core.world import Person, Room, World
from codebotler.simulator.engine import run
from codebotler.simulator.settings import SimulationSettings
from haste import hasten

pytestmark = pytest.mark.shared_engine

Outcomes: TypeAlias = dict[str, Outcome]

HOUSE = World(
    (
        Room("start_loc"),
        Room("amy's lab", ("stapler", "mug"), (Person(".*", ("2", "yes")),)),
        Room("bob's lab"),
    ),
    "start_loc",
)
ASKING = 'go_to("amy\'s lab")\n'


def task(body: str) -> str:
    return "def task_program():\n" + textwrap.indent(body, "    ") + "\n"


def texts_of(outcome: Outcome) -> list[str]:
    """Return the texts that the robot said in a finished run."""
    assert outcome.status == Status.FINISHED, outcome
    return [event.text for event in outcome.trace if event.kind == "say"]


def write_frame(text: str) -> str:
    """Return code that writes a frame to the channel, without a skill."""
    return f"import os\nos.write(3, {len(text).to_bytes(4, 'big') + text.encode()!r})\n"


def programs_of(*tables: dict[str, tuple[str, object]]) -> dict[str, str]:
    return {name: program for table in tables for name, (program, _) in table.items()}


def run_all(programs: dict[str, str], settings: SimulationSettings) -> Outcomes:
    pairs = ((program, HOUSE) for program in programs.values())
    return dict(zip(programs, run(pairs, workers=1, settings=settings), strict=True))


# --- programs that work: each says these texts

WORKS: dict[str, tuple[str, object]] = {
    # bugs of the original evaluator by number (SEMANTICS.md, section 9)
    "1 text with the name of a skill": (
        task("""say("amy's lab".replace("'s lab", ""))"""),
        ["amy"],
    ),
    "2 names that end in the name of a skill": (
        "def do_ask(q): say(q)\ndef essay(t): return t\nclass A:\n    def pick(self): return 'picked'\n"
        + task("do_ask('a')\nsay(essay('b'))\nsay(A().pick())"),
        ["a", "b", "picked"],
    ),
    "3 skills are values": (
        task("speak = say\nspeak('a')\nlist(map(say, ['b', 'c']))\nsay ('d')\nsay\nget_all_rooms"),
        ["a", "b", "c", "d"],
    ),
    "4 a space between the brackets": ("def task_program( ):\n    say('a')\n", ["a"]),
    "5 own call": (task("say('a')") + "task_program()\n", ["a"]),
    "5 own call under main": (task("say('a')") + "if __name__ == '__main__':\n    task_program()\n", ["a"]),
    "5 own call that failed and was caught": (
        task("say('a')\nraise ValueError") + "try:\n    task_program()\nexcept ValueError:\n    say('b')\n",
        ["a", "b"],
    ),
    "5 two own calls are two": (task("say('a')") + "task_program()\ntask_program()\n", ["a", "a"]),
    "5 own call of a lambda": ("task_program = lambda: say('a')\ntask_program()\n", ["a"]),
    "5 own call of another function": ("def main(): say('a')\ntask_program = main\ntask_program()\n", ["a"]),
    "5 own call by the other name": ("def main(): say('a')\ntask_program = main\nmain()\n", ["a"]),
    "5 own call of what is assigned in it": ("(task_program := lambda: say('a'))()\n", ["a"]),
    "5 another function was called": ("def main(): say('b')\nmain()\n" + task("say('a')"), ["b", "a"]),
    "clocks are no methods": (
        "class Timer:\n    clock, doze = time.monotonic, time.sleep\n"
        + task("timer = Timer()\ntimer.doze(2)\nsay(str(timer.clock()))"),
        ["2.0"],
    ),
    "5 own call of a partial": (
        "import functools\ntask_program = functools.partial(say, 'a')\ntask_program()\n",
        ["a"],
    ),
    "5 call by another name": (task("say('a')") + "main = task_program\nmain()\n", ["a"]),
    "5 method of that name is another": (
        "class A:\n    def task_program(self): say('b')\nA().task_program()\n" + task("say('a')"),
        ["b", "a"],
    ),
    "6 name in an f-string": (task("Greeting = 'Good Day!'\nsay(f'{Greeting}')"), ["good day!"]),
    "7 code between two quotes": (task("Text = 'a'\nsay('\"' + Text + '\"')"), ['"a"']),
    "8 literals of every kind are lowered": (
        task("if 'LAB' in \"amy's lab\" and '''A\n''' == \"\"\"a\n\"\"\" and R'A\\B' == 'a\\\\b': say('a')"),
        ["a"],
    ),
    "8 answer compared with another literal": (
        task(ASKING + "if ask('', 'Yes?', ['2', \"Yes\"]) == '2':\n    say(ask('', '', [\"Yes\", 'No']))"),
        ["yes"],
    ),
    "9 call within a string": (
        task("say('please say(yes) and go_to(there)')"),
        ["please say(yes) and go_to(there)"],
    ),
    "10 robot is an ordinary name": (task("robot = 'Robbie'\nsay(robot)"), ["robbie"]),
    "11 sleeping costs no real time": (
        task("time.sleep(2)\nfrom time import sleep\nsleep(1000)\ntime.sleep(1)\nsay(str(time.monotonic()))"),
        ["1003.0"],
    ),
    "12 output is ignored": (task("print('now in', get_current_location())\nsay('a')"), ["a"]),
    "13 line breaks are kept": (task(r"say('Hello!\nGood Day!')"), ["hello!\ngood day!"]),
    "14 output is no event": (task("print('Say /$@!/ x /$@!/ None')"), []),
    "15 list of rooms is a copy": (
        task(
            "rooms = get_all_rooms()\nrooms.remove('start_loc')\ngo_to('start_loc')\nsay(get_all_rooms()[0])"
        ),
        ["start_loc"],
    ),
    "17 much output of skills": (
        task("for i in range(400): is_in_room('backpack ' * 40)\nsay('a')"),
        ["a"],
    ),
    # a run (section 1)
    "sys and time are there": (task("if sys.maxsize and time.time(): say('a')"), ["a"]),
    "code outside functions runs first": ("say('a')\n" + task("say('b')"), ["a", "b"]),
    "exit": (task("say('a')\nexit()\nsay('b')"), ["a"]),
    "quit": (task("say('a')\nquit()"), ["a"]),
    "sys.exit(0)": (task("say('a')\nsys.exit(0)"), ["a"]),
    "sys.exit()": (task("say('a')\nsys.exit()"), ["a"]),
    "exit before the task": ("say('a')\nexit()\n" + task("say('b')"), ["a"]),
    "module is main": (
        task("import __main__\nsay(__main__.__name__)\nsay(__name__)"),
        ["__main__", "__main__"],
    ),
    # arguments (section 3)
    "arguments by name": (
        task(
            "go_to(location=\"amy's lab\")\nis_in_room(entity='mug')\npick(obj='mug')\nplace(obj='mug')\n"
            "say(message=ask(person='', question='q', options=['2']))"
        ),
        ["2"],
    ),
    "caught robot errors": (
        task(
            "for act in (lambda: go_to('x'), lambda: pick('x'), lambda: place('x'),\n"
            "            lambda: ask('', '', [])):\n"
            "    try:\n        act()\n    except Exception as error:\n        say(type(error).__name__)"
        ),
        ["GoToInvalidLocation", "PickInvalidObject", "PlaceNoObject", "AskEmptyOptions"],
    ),
    "very object of an option comes back": (
        task(
            ASKING + "two = ['2']\nclass Yes:\n    def __str__(self): return 'yes'\nyes = Yes()\n"
            "if ask('', '', [1, two]) is two: say('a')\n"
            "if ask('', '', [None, yes]) is yes: say('b')\n"
            "if ask('', '', [True, 'Yes', 2.5]) == 'yes': say('c')"
        ),
        ["a", "b", "c"],
    ),
    # literals and the shape of the program
    "format specifications are code": (
        task("say(f'{255:X}|{3.14159:.2F}|{7!R:>5}|ABC')".replace("!R", "!r")),
        ["FF|3.14|    7|abc"],
    ),
    "a log with a wrong format": (
        "import logging\n"
        + task("logging.warning('found %d', 'kitchen')\nlogging.warning('a', 1)\nsay('done')"),
        ["done"],
    ),
    "bytes are no text": (task("say(b'ABC'.decode())"), ["ABC"]),
    "match": (
        task(
            "match {'Kind': 'Lab', 'n': 3}:\n    case {'KIND': 'LAB' | 'X', 'n': int(n)} if n > 2:\n"
            "        say(f'got {n}')\n    case _:\n        say('none')"
        ),
        ["got 3"],
    ),
    "docstrings stay docstrings": (
        '"""Module."""\nfrom __future__ import annotations\nclass A:\n    """Class."""\n'
        + task('"""Task."""\nsay(task_program.__doc__)\nsay(A.__doc__)\nsay(__doc__)'),
        ["task.", "class.", "module."],
    ),
    "wide Python": (
        task(
            "import re, json, math, collections, itertools\n"
            "P = collections.namedtuple('p', 'x')\n"
            "say(str(P(1))); say(str(re.findall('b+', 'abbab'))); say(json.dumps({'a': [1]}))\n"
            "say(str(sum(x for x in range(9) if x % 2))); say(str((lambda *a, k=1: a + (k,))(1, 2)))\n"
            "say(str([y := 3, y ** 2])); say(str(collections.Counter('aab')))\n"
            "try:\n    raise ExceptionGroup('g', [ValueError(1)])\nexcept* ValueError:\n    say('group')"
        ),
        [
            "p(x=1)",
            "['bb', 'b']",
            '{"a": [1]}',
            "16",
            "(1, 2, 1)",
            "[3, 9]",
            "Counter({'a': 2, 'b': 1})",
            "group",
        ],
    ),
    "generators, decorators, context managers": (
        "import contextlib, functools\n"
        "def gen():\n    yield from 'ab'\n"
        "@functools.cache\ndef f(n): return n if n < 2 else f(n - 1) + f(n - 2)\n"
        "@contextlib.contextmanager\ndef ctx():\n    yield 'in'\n    say('out')\n"
        + task("say(''.join(gen()))\nsay(str(f(30)))\nwith ctx() as word: say(word)"),
        ["ab", "832040", "in", "out"],
    ),
    "recursion as deep for a function that calls a skill": (
        "n = 0\ndef f():\n    global n\n    get_current_location()\n    n += 1\n    f()\n"
        + task("try:\n    f()\nexcept RecursionError:\n    say(str(n))"),
        ["990"],
    ),
    "recursion as deep for a function that only calls itself": (
        "n = 0\ndef f():\n    global n\n    n += 1\n    f()\n"
        + task("try:\n    f()\nexcept RecursionError:\n    say(str(n))"),
        ["990"],
    ),
    "what the sandbox needs cannot be taken from it": (
        "import builtins, json, os, sys\n"
        "for name in ('len', 'str', 'isinstance', 'type', 'zip', 'int', 'list'):\n"
        "    setattr(builtins, name, None)\n"
        "json.dumps = json.loads = os.read = os.write = sys.setrecursionlimit = None\n"
        + task("say('a')\ngo_to(\"amy's lab\")\nsay(ask('', '', ['2']))"),
        ["a", "2"],
    ),
    "robot errors of one kind are of one class": (
        task(
            "kinds = []\nfor room in 'xy':\n    try:\n        go_to(room)\n"
            "    except Exception as error: kinds.append(type(error))\n"
            "say(str(kinds[0] is kinds[1]))"
        ),
        ["True"],
    ),
    "what is known is asked again": (
        task(
            "for i in range(2): say(str(is_in_room('mug')))\ngo_to(\"amy's lab\")\n"
            "for i in range(2): say(str(is_in_room('mug')))\npick('mug')\n"
            "say(str(is_in_room('stapler')) + get_current_location())\n"
            "get_all_rooms().clear()\nsay(str(len(get_all_rooms())))"
        ),
        ["False", "False", "True", "True", "Trueamy's lab", "3"],
    ),
    "timed waits cost simulated time": (
        task(
            "import queue, select, threading\n"
            "threading.Event().wait(2)\nsay(str(time.monotonic()))\n"
            "try:\n    queue.Queue().get(timeout=100)\nexcept queue.Empty:\n    say(str(time.monotonic()))\n"
            "try:\n    queue.SimpleQueue().get(timeout=3)\nexcept queue.Empty: say(str(time.monotonic()))\n"
            "lock = threading.Lock()\nwith lock:\n    say(str(lock.acquire(timeout=5)))\n"
            "say(str(lock.acquire(False)) + str(lock.acquire(False)) + str(time.monotonic()))\n"
            "threading.Condition().__enter__()\nselect.select([], [], [], 10)\nsay(str(time.monotonic()))\n"
            "with threading.RLock() as held: say(str(held))"
        ),
        ["2.0", "102.0", "105.0", "False", "TrueFalse110.0", "120.0", "True"],
    ),
    "timed waits cost simulated time without any import": (
        task(
            "lock = __import__('_thread').allocate_lock()\nlock.acquire()\n"
            "say(str(lock.acquire(True, 0.5)) + str(time.monotonic()))"
        ),
        ["False0.5"],
    ),
    "dates are what they seem": (
        "import datetime, pickle\nclass D(datetime.datetime): pass\n"
        + task(
            "now = datetime.datetime.now()\n"
            "say(str((isinstance(now, D), isinstance(now, datetime.date))))\n"
            "say(str(issubclass(D, datetime.datetime)))\n"
            "say(str(pickle.loads(pickle.dumps(now.date())) == now.date()))\nsay(str(D.now()))"
        ),
        ["(False, True)", "True", "True", "2024-01-01 12:00:00"],
    ),
    "a task that returns a coroutine": (
        "async def note(): pass\n" + task("say('a')\nreturn note()"),
        ["a"],
    ),
    "a task that is begun by hand": (
        "async def task_program(): say('a')\ntry: task_program().send(None)\nexcept StopIteration: pass\n",
        ["a"],
    ),
    "nothing is left of what ran before in the fork_server": (
        task(
            "say(' '.join(name for name in sorted(globals()) if name[0] != '_'))\nsay(str(time.monotonic()))"
        ),
        [
            "ask get_all_rooms get_current_location go_to is_in_room pick place say sys task_program time",
            "0.0",
        ],
    ),
    "selectors and executors are there": (
        "import concurrent.futures, selectors, threading, platform, os\n"
        + task(
            "selectors.SelectSelector().select(2)\nsay(str(time.monotonic()))\n"
            "concurrent.futures.ThreadPoolExecutor()\nsay(platform.node() + sys.executable)\n"
            "say(f'{os.cpu_count()} {os.sched_getaffinity(0)}')\n"
            "try:\n    threading.RLock().release()\nexcept RuntimeError as error: say(str(error))"
        ),
        ["2.0", "robot", "1 {0}", "cannot release un-acquired lock"],
    ),
    "no folder of the machine is told": (
        "import json, traceback\n"
        + task(
            "told = ''\ndef choose(): from random import choise\n"
            "for act in (lambda: json.loads('{'), lambda: go_to('x'), choose):\n"
            "    try: act()\n    except Exception: told += traceback.format_exc()\n"
            "say(str(('decoder.py' in told, 'choise' in told, '/' in told)))"
        ),
        ["(True, True, False)"],
    ),
    "chance and identities repeat": (
        task(
            "import _random, os, random, threading, uuid\n"
            "for kind in (_random.Random, random.Random, type(random._inst)): say(str(kind().random()))\n"
            "say(str((os.getpid(), threading.get_native_id(), threading.main_thread().native_id)))\n"
            "say(str(uuid.uuid1(clock_seq=7)))"
        ),
        [*["0.8444218515250481"] * 3, "(1, 1, 1)", "4a016000-a89d-11ee-8007-000000000001"],
    ),
    "prints a gigabyte": (task("text = 'x' * 10**6\nfor i in range(1000): print(text)\nsay('a')"), ["a"]),
    "swallows a caught stop of its own": (task("try:\n    exit()\nexcept SystemExit:\n    say('a')"), ["a"]),
}
# --- programs that fail: each ends with this status, kind of error and message

T = Status.TIMEOUT
P = Status.PYTHON_ERROR
FORGED_MESSAGE = "the program wrote to the sandbox channel"
TOO_MANY_TURNS = "200,000 loop iterations and function calls"
TOO_DEEP = "the program is too large, or nested too deeply"
SUPPRESSES_ERRORS = "from contextlib import suppress\nwith suppress(BaseException):\n    while 1: pass\n"
FAILS: dict[str, tuple[str, object]] = {
    "16 endless recursion keeps its class": (
        (
            "def visit(r):\n    try:\n        is_in_room(r)\n    finally:\n        visit(r)\n"
            "def task_program():\n    visit('a')\n"
        ),
        (P, "RecursionError", None),
    ),
    "20 task with a parameter": (
        "def task_program(robot):\n    say('a')\n",
        (P, "TypeError", "task_program() missing 1 required positional argument: 'robot'"),
    ),
    "task that nobody awaits": (
        "async def task_program():\n    say('a')\n",
        (P, "TypeError", "task_program is a coroutine, which nobody awaits; write def, not async def"),
    ),
    "task that is called and that nobody awaits": (
        "async def task_program():\n    say('a')\n\ntask_program()\n",
        (P, "TypeError", "task_program is a coroutine, which nobody awaits; write def, not async def"),
    ),
    "no task": ("def main():\n    say('a')\n", (P, "NameError", "name 'task_program' is not defined")),
    "nothing": ("", (P, "NameError", "name 'task_program' is not defined")),
    "simulator is hidden": (task("robot.go_to('x')"), (P, "NameError", "name 'robot' is not defined")),
    "state is hidden": (task("state"), (P, "NameError", "name 'state' is not defined")),
    "input": (task("input()"), (P, "EOFError", "EOF when reading a line")),
    "exit with a string": (task("sys.exit('text')"), (P, "SystemExit", "text")),
    "exit with a number": (task("sys.exit(3)"), (P, "SystemExit", "3")),
    "no Python": ("def task_program(:\n", (P, "SyntaxError", "invalid syntax")),
    "a null character": ("say('a')\0", (P, "SyntaxError", None)),
    "a lone surrogate": ("say('\ud800')", (P, "UnicodeEncodeError", None)),
    "too many brackets": ("(" * 5000, (P, "SyntaxError", None)),
    "too deep to parse": ("-" * 100_000 + "1", (P, None, None)),
    "module that is not there": (task("import numpy"), (P, "ModuleNotFoundError", "No module named 'numpy'")),
    "error without a string": (
        task("class E(Exception):\n    def __str__(self): raise KeyError\nraise E"),
        (P, "E", ""),
    ),
    # types (section 3): no event
    "text is a number": (task("say(3)"), (P, "TypeError", "say: message must be text, not int")),
    "text is None": (task("go_to(None)"), (P, "TypeError", "go_to: location must be text, not NoneType")),
    "text of a subclass": (
        task("class Str(str): pass\npick(Str('mug'))"),
        (P, "TypeError", "pick: obj must be text, not Str"),
    ),
    "options are a tuple": (
        task("ask('', '', ('a', 'b'))"),
        (P, "TypeError", "ask: options must be a list, not tuple"),
    ),
    "options are a range": (task("ask('', '', range(3))"), (P, "TypeError", None)),
    "options are a dict view": (task("ask('', '', {'a': 1}.keys())"), (P, "TypeError", None)),
    "options are a subclass of list": (
        task("class L(list): pass\nask('', '', L('ab'))"),
        (P, "TypeError", "ask: options must be a list, not L"),
    ),
    "person is no text": (task("ask(None, '', ['a'])"), (P, "TypeError", None)),
    "too few arguments": (
        task("go_to()"),
        (P, "TypeError", "go_to() missing 1 required positional argument: 'location'"),
    ),
    "too many arguments": (
        task("get_all_rooms(1)"),
        (P, "TypeError", "get_all_rooms() takes 0 positional arguments but 1 was given"),
    ),
    "argument by another name": (
        task("say(text='a')"),
        (P, "TypeError", "say() got an unexpected keyword argument 'text'"),
    ),
    # programs that catch the error of a limit
    "endless loop": (task("while True: pass"), (T, "TimeoutError", TOO_MANY_TURNS)),
    "swallows in a loop": (
        task("while True:\n    try:\n        while True: pass\n    except BaseException: pass"),
        (T, "TimeoutError", TOO_MANY_TURNS),
    ),
    "swallows once and ends": (
        task("try:\n    while True: pass\nexcept BaseException: pass"),
        (T, "TimeoutError", TOO_MANY_TURNS),
    ),
    "swallows and acts": (
        task("try:\n    while True: pass\nexcept: pass\nfinally:\n    say('a')"),
        (T, "TimeoutError", TOO_MANY_TURNS),
    ),
    "swallows by continue in finally": (
        task("while True:\n    try:\n        while True: pass\n    finally:\n        continue"),
        (T, "TimeoutError", TOO_MANY_TURNS),
    ),
    "swallows by suppress": (
        task(
            "from contextlib import suppress\nwhile 1:\n"
            "    with suppress(BaseException):\n        while 1: pass"
        ),
        (T, "TimeoutError", TOO_MANY_TURNS),
    ),
    "swallows in a generator": (
        task("def g():\n    while 1:\n        try: yield\n        except: pass\nfor _ in g(): pass"),
        (T, "TimeoutError", TOO_MANY_TURNS),
    ),
    "swallows in recursion": (
        "def f():\n    try:\n        while 1: pass\n    except BaseException: f()\n" + task("f()"),
        (T, "TimeoutError", TOO_MANY_TURNS),
    ),
    "swallows in __del__": (
        task("class A:\n    def __del__(self):\n        while True: pass\nA()\nsay('a')"),
        (T, "TimeoutError", TOO_MANY_TURNS),
    ),
    "spends in a comprehension": (task("[0 for i in range(10**9)]"), (T, "TimeoutError", TOO_MANY_TURNS)),
    "spends in a lambda": (task("sum(map(lambda x: x, range(10**9)))"), (T, "TimeoutError", TOO_MANY_TURNS)),
    "exits after the budget": (task(SUPPRESSES_ERRORS + "exit()"), (T, "TimeoutError", TOO_MANY_TURNS)),
    "ends after the budget": (task(SUPPRESSES_ERRORS + "1"), (T, "TimeoutError", TOO_MANY_TURNS)),
    "fails after the budget": (task(SUPPRESSES_ERRORS + "1 / 0"), (T, "TimeoutError", TOO_MANY_TURNS)),
    "acts after the budget": (task(SUPPRESSES_ERRORS + "say('a')"), (T, "TimeoutError", TOO_MANY_TURNS)),
    "one turn too many": (task("for i in range(200_000): pass"), (T, "TimeoutError", TOO_MANY_TURNS)),
    "a string that is too long to send": (
        task("say('x' * 2_000_000)"),
        (T, "TimeoutError", "a text of more than 10,000 characters"),
    ),
    # deceptive exceptions
    "raises the robot's error anew": (
        task("try:\n    go_to('x')\nexcept Exception as error:\n    raise type(error)('mine')"),
        (Status.ROBOT_ERROR, "GoToInvalidLocation", 'there is no room "x"'),
    ),
    "exception of a class that lies about its name": (
        task(
            "class M(type):\n    __name__ = property(lambda cls: 1 / 0)\n"
            "class E(Exception, metaclass=M): pass\nraise E('a')"
        ),
        (P, "E", "a"),
    ),
    "exception that lies about its class": (
        task(
            "class E(Exception):\n    __class__ = property(lambda self: 1 / 0)\n"
            "    __traceback__ = code = number = property(lambda self: 1 / 0)\n"
            "    def __eq__(self, other): return 1 / 0\n    def __str__(self): return 1 / 0\nraise E('a')"
        ),
        (P, "E", ""),
    ),
    "exit of a class that lies about its code": (
        task("class E(SystemExit):\n    code = property(lambda self: None)\nraise E(3)"),
        (P, "E", "3"),
    ),
    # programs that do not parse
    "null character": ("x = 1\ny = '\0'\n", (P, "SyntaxError", "source code cannot contain null characters")),
    "nested too deeply": ("x = " + "[" * 150 + "-" * 150 + "1" + "]" * 150, (P, "MemoryError", TOO_DEEP)),
    "nested far too deeply": ("x = " + "-" * 100_000 + "1", (P, "MemoryError", TOO_DEEP)),
    "too many blocks": (
        "".join(" " * n + "while 1:\n" for n in range(21)) + " " * 21 + "pass\n",
        (P, "SyntaxError", "too many statically nested blocks"),
    ),
    "imports what is ours": (
        "import codebotler\n",
        (P, "ModuleNotFoundError", "No module named 'codebotler'"),
    ),
    "imports what nobody has": ("import numpy\n", (P, "ModuleNotFoundError", "No module named 'numpy'")),
    "imports it by a call": (
        "__import__('numpy')\n",
        (P, "ModuleNotFoundError", "No module named 'numpy'"),
    ),
    # programs that hang, and calls that the kernel refuses
    "hangs in C": (
        task("sum(range(10**12))"),
        (T, "TimeoutError", "5 seconds of processor time"),
    ),
    "deadlock": (
        task("import threading\nlock = threading.Lock()\nlock.acquire()\nlock.acquire()"),
        (T, "TimeoutError", "a wait for something that can never happen"),
    ),
    "allocates without end": (
        task("parts = []\nwhile True: parts.append(bytearray(10**7))"),
        (P, "MemoryError", ""),
    ),
    "allocates all at once": (task("'x' * 10**12"), (P, "MemoryError", "")),
    "ends its process": (
        task("import os\nos._exit(0)"),
        (Status.KILLED, "Crash", "the process ended by itself (exit status 0)"),
    ),
    "crashes": (
        task("import ctypes\nctypes.string_at(0)"),
        (Status.KILLED, "Crash", "the process ended by itself (signal 11)"),
    ),
    "aborts": (task("import os\nos.abort()"), (Status.KILLED, "Crash", None)),
    "kills itself": (task("import os\nos.kill(os.getpid(), 9)"), (P, "PermissionError", None)),
    "raises a signal": (task("import signal\nsignal.raise_signal(9)"), (P, "PermissionError", None)),
    "kills everybody": (task("import os\nos.kill(-1, 9)"), (P, "PermissionError", None)),
    "reads a file": (task("open('/etc/passwd')"), (P, "PermissionError", None)),
    "writes a file": (task("open('/tmp/x', 'w')"), (P, "PermissionError", None)),
    "lists a folder": (task("import os\nos.listdir('/')"), (P, "PermissionError", None)),
    "opens a socket": (task("import socket\nsocket.socket()"), (P, "PermissionError", None)),
    "forks": (task("import os\nos.fork()"), (P, "PermissionError", None)),
    "starts a process": (task("import subprocess\nsubprocess.run(['true'])"), (P, "PermissionError", None)),
    "starts a thread": (
        task("import threading\nthreading.Thread(target=print).start()"),
        (P, "RuntimeError", None),
    ),
    "closes the line": (task("import os\nos.close(3)"), (P, "PermissionError", None)),
    "says nonsense on the line": (
        task(write_frame("junk")),
        (Status.KILLED, "Crash", FORGED_MESSAGE),
    ),
    "says too much on the line": (
        task("import os\nos.write(3, b'\\xff\\xff\\xff\\xff')"),
        (Status.KILLED, "Crash", FORGED_MESSAGE),
    ),
    "says null on the line": (
        task(write_frame("null") + "say('a')"),
        (Status.KILLED, "Crash", None),
    ),
    "asks for a skill that is none": (
        task(write_frame('["fly", [3]]')),
        (Status.KILLED, "Crash", FORGED_MESSAGE),
    ),
    "asks with another type": (
        task(write_frame('["say", [3]]')),
        (Status.KILLED, "Crash", FORGED_MESSAGE),
    ),
    "forges a robot error": (
        task(write_frame('{"end": "robot-error", "number": 99}')),
        (Status.KILLED, "Crash", None),
    ),
}


# --- lines: each program ends in this kind of error at this line

LINES: dict[str, tuple[str, object]] = {
    "a name that is none": (task("say('a')\n\nundefined"), ("NameError", 4)),
    "in a function": ("def f():\n    1 / 0\n\n" + task("f()"), ("ZeroDivisionError", 2)),
    "in the library": (task("import json\njson.loads('{')"), ("JSONDecodeError", 3)),
    "in what does not parse": ("x = 1\nif x:\n", ("IndentationError", 2)),
    "in a skill": (task("say('a')\ngo_to('attic')"), ("GoToInvalidLocation", 3)),
    "in a loop": (task("for i in range(3):\n    pick('mug')"), ("PickInvalidObject", 3)),
    "in a loop without end": (task("\n\nwhile True:\n    x = 1"), ("TimeoutError", 5)),
    "null character": ("x = 1\ny = '\0'\n", ("SyntaxError", 2)),
    "too many blocks": (
        "".join(" " * n + "while 1:\n" for n in range(21)) + " " * 21 + "pass\n",
        ("SyntaxError", 21),
    ),
    "nowhere": ("def main(): pass\n", ("NameError", None)),
    **{
        f"sleeping for {wrong or 'nothing'}": (task(f"say('a')\ntime.sleep({wrong})"), (kind, 3))
        for wrong, kind in {
            "-1": "ValueError",
            "float('nan')": "ValueError",
            "float('inf')": "ValueError",
            "'1'": "TypeError",
            "None": "TypeError",
            "": "TypeError",
        }.items()
    },
}

# --- limits: code within the limit, code beyond it, and the message

LIMITS = {
    "time": ("for i in range(3600): time.sleep(1)", "time.sleep(0.1)", "3,600 seconds of simulated time"),
    "calls": ("for i in range(1000): say(str(i))", "get_all_rooms()", "1,000 skill calls"),
    "ticks": ("for i in range(199_998): pass", "[0 for i in 'ab']", TOO_MANY_TURNS),
    "text": ("say('x' * 10_000)", "say('x' * 10_001)", "a text of more than 10,000 characters"),
    "option": ("say('x')", "ask('', '', ['x' * 10_001])", "a text of more than 10,000 characters"),
    "trace": (
        "for i in range(100): say('x' * 10_000)",
        "say('x')",
        "texts of more than 1,000,000 characters in total",
    ),
}
WITHIN: dict[str, tuple[str, object]] = {
    f"within {name}": (task(inside), None) for name, (inside, _, _) in LIMITS.items()
}
BEYOND: dict[str, tuple[str, object]] = {
    f"beyond {name}": (task(f"{inside}\n{outside}"), None) for name, (inside, outside, _) in LIMITS.items()
}
SLOW = ("hangs in C", "deadlock")
HONEST = task("say('honest')")


@pytest.fixture(scope="module")
def outcomes() -> Outcomes:
    """Return the outcomes of the quick programs, with an honest program after each that fails."""
    programs = programs_of(LINES, WITHIN, BEYOND, WORKS)
    for number, name in enumerate(FAILS):
        if name not in SLOW:
            programs |= {name: FAILS[name][0], f"after {name}": task(f"say('honest {number}')")}
    return run_all(programs, SimulationSettings())


@pytest.fixture(scope="module")
def slow_outcomes() -> Outcomes:
    """Return the outcomes of programs that the engine must end, with an honest program after each."""
    programs = {
        name: source for slow in SLOW for name, source in ((slow, FAILS[slow][0]), (f"after {slow}", HONEST))
    }
    with pytest.MonkeyPatch.context() as patch:
        hasten(patch)
        return run_all(programs, SimulationSettings())


@pytest.mark.parametrize("name", WORKS)
def test_program_works(outcomes: Outcomes, name: str) -> None:
    assert texts_of(outcomes[name]) == WORKS[name][1]


@pytest.mark.slow
@pytest.mark.parametrize("name", SLOW)
def test_program_that_hangs_is_ended_without_harm_to_the_next_one(slow_outcomes: Outcomes, name: str) -> None:
    assert_expected_failure(slow_outcomes, name)
    assert texts_of(slow_outcomes[f"after {name}"]) == ["honest"]


@pytest.mark.parametrize("name", [name for name in FAILS if name not in SLOW])
def test_program_fails_with_its_status_without_harm_to_the_next_one(outcomes: Outcomes, name: str) -> None:
    assert_expected_failure(outcomes, name)
    assert texts_of(outcomes[f"after {name}"]) == [f"honest {list(FAILS).index(name)}"]


def assert_expected_failure(outcomes: Outcomes, name: str) -> None:
    expected = FAILS[name][1]
    assert isinstance(expected, tuple)
    status, kind, message = expected
    outcome = outcomes[name]
    assert outcome.error is not None
    assert outcome.status == status
    assert kind in (None, outcome.error.kind)
    assert outcome.error.message.startswith(message or "")
    if kind not in ("RecursionError", "GoToInvalidLocation"):
        assert outcome.trace == ()


def run_one(program: str, settings: SimulationSettings | None = None, world: World = HOUSE) -> Outcome:
    (outcome,) = run([(program, world)], workers=1, settings=settings or SimulationSettings())
    return outcome


# --- the clock

CLOCK: dict[str, tuple[str, object]] = {
    "time": ("time.time()", "1704110490.5"),
    "time_ns": ("time.time_ns()", "1704110490500000000"),
    "monotonic": ("time.monotonic()", "90.5"),
    "perf_counter": ("time.perf_counter()", "90.5"),
    "perf_counter_ns": ("time.perf_counter_ns()", "90500000000"),
    "process_time": ("time.process_time()", "90.5"),
    "strftime": ("time.strftime('%Y-%m-%d %H:%M:%S')", "2024-01-01 12:01:30"),
    "localtime": ("time.localtime().tm_min", "1"),
    "gmtime": ("time.gmtime(None).tm_sec", "30"),
    "gmtime of a time": ("time.gmtime(0).tm_year", "1970"),
    "ctime": ("time.ctime()", "Mon Jan  1 12:01:30 2024"),
    "asctime": ("time.asctime()", "Mon Jan  1 12:01:30 2024"),
    "datetime.now": ("datetime.datetime.now()", "2024-01-01 12:01:30.500000"),
    "datetime.now with a zone": ("datetime.datetime.now(datetime.UTC)", "2024-01-01 12:01:30.500000+00:00"),
    "datetime.today": ("datetime.datetime.today()", "2024-01-01 12:01:30.500000"),
    "datetime.utcnow": ("datetime.datetime.utcnow()", "2024-01-01 12:01:30.500000"),
    "date.today": ("datetime.date.today()", "2024-01-01"),
    "strptime": ("datetime.datetime.strptime('13:30', '%H:%M').hour", "13"),
    "difference": ("datetime.datetime.now() - datetime.datetime(2024, 1, 1)", "12:01:30.500000"),
    "instance": ("isinstance(datetime.datetime.now(), datetime.date)", "True"),
    "repr": ("repr(datetime.datetime.now())", "datetime.datetime(2024, 1, 1, 12, 1, 30, 500000)"),
    "timeit": ("__import__('timeit').default_timer()", "90.5"),
}


@pytest.fixture(scope="module")
def clock() -> list[str]:
    body = "".join(f"say(str({expression}))\n" for expression, _ in CLOCK.values())
    return texts_of(
        run_one(
            "import datetime\n" + task("time.sleep(90.5)\n" + body), SimulationSettings(literals="as-written")
        )
    )


@pytest.mark.parametrize("name", CLOCK)
def test_every_clock_shows_the_simulated_time(clock: list[str], name: str) -> None:
    assert clock[list(CLOCK).index(name)] == CLOCK[name][1]


def test_events_have_the_simulated_time_and_sleep_leaves_no_event() -> None:
    outcome = run_one(task("say('a')\ntime.sleep(3.5)\nsay('b')\ntime.sleep(True)\nsay('c')"))
    assert [event.time for event in outcome.trace] == [0.0, 3.5, 4.5]


# --- limits


@pytest.mark.parametrize("name", LIMITS)
def test_program_is_ended_only_beyond_the_limit(outcomes: Outcomes, name: str) -> None:
    assert outcomes[f"within {name}"].status == Status.FINISHED
    outcome = outcomes[f"beyond {name}"]
    assert outcome.status == Status.TIMEOUT
    assert outcome.error == RunError("TimeoutError", LIMITS[name][2])
    assert outcome.line == 3


def test_trace_up_to_the_limit_is_kept_and_ends_there() -> None:
    swallowing = (
        "n = 0\nwhile True:\n    try:\n        n += 1\n        say(str(n))\n    except BaseException: pass"
    )
    outcome = run_one(task(swallowing))
    assert outcome.status == Status.TIMEOUT
    assert [event.text for event in outcome.trace] == [str(n) for n in range(1, 1001)]


# --- the rest


def test_literals_are_kept_as_written_if_the_suite_says_so() -> None:
    program = task('"""Doc."""\nsay(\'ABC\')\nsay(f\'X{1:X}\')\nsay(task_program.__doc__)')
    assert texts_of(run_one(program, SimulationSettings(literals="as-written"))) == ["ABC", "X1", "Doc."]
    assert texts_of(run_one(program)) == ["abc", "x1", "doc."]


def test_options_that_are_not_text_are_marked_in_the_trace() -> None:
    outcome = run_one(task(ASKING + "ask('', 'q', [1, None, 'Two', 2])"))
    options = (
        Option("1", is_text=False),
        Option("None", is_text=False),
        Option("two"),
        Option("2", is_text=False),
    )
    assert outcome.trace == (Event("goto", "amy's lab"), Event("ask", "q", options, answer="2"))


def test_options_are_recorded_as_at_the_time_of_the_call() -> None:
    outcome = run_one(task(ASKING + "options = ['2']\nask('', 'q', options)\noptions.append('3')"))
    assert outcome.trace[-1].options == (Option("2"),)


@pytest.mark.parametrize("name", LINES)
def test_outcome_names_the_line_of_the_program(outcomes: Outcomes, name: str) -> None:
    outcome = outcomes[name]
    assert outcome.error is not None
    assert (outcome.error.kind, outcome.line) == LINES[name][1]


def test_uncaught_robot_error_keeps_the_trace_and_the_message() -> None:
    assert run_one(task("say('a')\ngo_to('Attic')")) == Outcome(
        Status.ROBOT_ERROR,
        (Event("say", "a"), Event("goto", "attic")),
        RunError("GoToInvalidLocation", 'there is no room "attic"'),
        3,
    )


def test_imitated_robot_error_is_an_error_of_the_program() -> None:
    copied = "class GoToInvalidLocation(Exception): number = 0\n"
    outcome = run_one(copied + task("raise GoToInvalidLocation('x')"))
    assert (outcome.status, outcome.error) == (Status.PYTHON_ERROR, RunError("GoToInvalidLocation", "x"))


def test_two_runs_cannot_see_each_other() -> None:
    marks = """
import builtins, os, random, sys
builtins.sorted = lambda x: 99
builtins.MARK = random.marker = 1
os.environ["MARK"] = "1"
sys.modules["marker"] = random
random.random()
time.sleep(50)
sys.setrecursionlimit(500)
print = say
"""
    looks = """
import builtins, os, random, sys
say(str(sorted("ba")))
say(str(hasattr(random, "marker")))
say(str(hasattr(builtins, "MARK")))
say(str("MARK" in os.environ))
say(str("marker" in sys.modules))
say(str(time.monotonic()))
say(str(sys.getrecursionlimit() > 900))
print("x")
say(str(random.random()))
"""
    settings = SimulationSettings(literals="as-written")
    pairs = [(task(looks), HOUSE), (marks + task("say('a')"), HOUSE), (task(looks + "\n"), HOUSE)]
    before, between, after = run(pairs, workers=1, settings=settings)
    assert texts_of(between) == ["a"]
    assert texts_of(before)[:-1] == ["['a', 'b']", "False", "False", "False", "False", "0.0", "True"]
    assert after == before


def test_worlds_of_one_program_cannot_see_each_other() -> None:
    program = "count = 0\n" + task(
        "global count\ndef f(x=[]):\n    x.append(1)\n    return len(x)\ncount += 1\nsay(str(f() + count))"
    )
    worlds = [World((Room("a"),), "a", about=str(number)) for number in range(4)]
    outcomes = list(run([(program, world) for world in worlds], workers=1))
    assert [texts_of(outcome) for outcome in outcomes] == [["2"]] * 4
