import ast
import os
import signal
import subprocess
import sys
import threading

import pytest

from codebotler.core import program
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Parameter, Skill
from codebotler.core.skills.values import NO_VALUE
from codebotler.models.recorded import RECORDED_NAMES, open_recorded
from codebotler.prompts.extract import program_of
from flaws import find_flaws

RECORDED = [
    reply
    for name in RECORDED_NAMES
    for them in open_recorded(f"recorded:{name}").replies.values()
    for reply in them
]
UNPARSABLE = {"SyntaxError", "IndentationError"}

TASK = 'def task_program():\n    go_to("kitchen")\n    say("hello")\n'
BODY = '    go_to("kitchen")\n    say("hello")\n'
TRUNCATED = 'def task_program():\n    go_to("kitchen")\n    say("hel'
HELPER = "def rooms():\n    return get_all_rooms()\n"
USES_HELPER = "def task_program():\n    for room in rooms():\n        go_to(room)\n"


def problems(text: str) -> list[tuple[int | None, str]]:
    return [(p.line, p.message) for p in find_flaws(text)]


def in_task(*statements: str) -> str:
    return "\n".join(["def task_program():", *("    " + s for s in statements)])


def fence(code: str, info: str = "python", marks: str = "```") -> str:
    return f"{marks}{info}\n{code}{marks}\n"


@pytest.mark.parametrize("step", [5, pytest.param(1, marks=pytest.mark.slow)])
def test_correct_recorded_programs_have_no_problems(step: int) -> None:
    for reply in RECORDED[::step]:
        found = find_flaws(reply.program)
        if reply.fails is None:
            assert found == (), reply.about
        elif reply.fails in {*UNPARSABLE, "NameError", "AskEmptyOptions"}:
            assert reply.fails in {p.kind for p in found}, reply.about


@pytest.mark.parametrize(
    ("text", "line", "named"),
    [
        ("def task_program(:\n    pass", 1, ["parse", "invalid syntax"]),
        ("def task_program():\n    pass\nreturn", 3, ["parse", "'return' outside function"]),
        ("def other():\n    pass", None, ["task_program"]),
        ("class A:\n    def task_program(self):\n        pass", None, ["task_program", "module level"]),
        ("def task_program(robot, *, now, x=1):\n    pass", 1, ["task_program", "robot and now"]),
        ("async def task_program():\n    pass", 1, ["task_program", "coroutine"]),
        (in_task("say(wish + wish)"), 2, ["name wish"]),
        (in_task("x += 1"), 2, ["name x "]),
        (in_task("say(x)", "x = 'a'") + "\nx = 'b'", 2, ["local variable x "]),
        (in_task("say = say('a')"), 2, ["local variable say "]),
        (
            in_task("x = 1", "ask('a', 'b')"),
            3,
            ["ask(person: str, ", "'options'"],
        ),
        (in_task("go_to()"), 2, ["go_to", "missing", "location"]),
        (in_task("get_all_rooms(1)"), 2, ["get_all_rooms()", "too many"]),
        (in_task("pick(item='a')"), 2, ["pick", "missing", "obj"]),
        (in_task("pick('a', obj='a')"), 2, ["pick", "multiple values", "obj"]),
        (in_task("ask('a', 'b', [])"), 2, ["options of ask", "empty list"]),
        (in_task("ask('a', 'b', options=[])"), 2, ["options of ask", "empty list"]),
        (in_task("ask('a', 'b', ('a',))"), 2, ["options of ask", "a list"]),
        (in_task("ask('a', 'b', 'c')"), 2, ["options of ask", "a list"]),
        (in_task("ask('a', 'b', {})"), 2, ["options of ask", "a list"]),
        (in_task("ask('a', 'b', {'a'})"), 2, ["options of ask", "a list"]),
        (in_task("ask('a', 'b', None)"), 2, ["options of ask", "a list"]),
    ],
)
def test_problem_has_its_line_and_names_the_cause(text: str, line: int | None, named: list[str]) -> None:
    ((found, message),) = problems(text)
    assert found == line
    assert all(name in message for name in named), message


@pytest.mark.parametrize(
    "text",
    [
        in_task("time.sleep(1)", "print(sys.argv)", "say(__name__)"),
        in_task("ask(*[1, 2])", "ask(**{})", "ask('a', **x())") + "\ndef x(): return {}",
        in_task("ask('a', 'b', ['a', *get_all_rooms(), f'{1}', str(2), 'x' + 'y'])"),
        in_task("ask(options=['a'], question='b', person='c')", "ask('a', 'b', [r for r in 'ab'])"),
        "def go_to(a, b):\n    pass\n" + in_task("go_to(1, 2)"),
        in_task("for say in [print]:", "    say()"),
        in_task("try:", "    x", "except NameError:", "    pass"),
        in_task("x: 'Undefined' = 1", r"say('\d')", "say('a') if 1 is 1 else 0"),
        "from math import *\n" + in_task("say(str(pi))"),
        "if True:\n    def task_program():\n        pass",
        "task_program = lambda: say('a')",
        "def task_program(a=1, *b, c=2, **d):\n    pass",
        "@lambda f: (lambda: f(1))\ndef task_program(a):\n    pass",
    ],
)
def test_valid_program_has_no_problem(text: str) -> None:
    assert problems(text) == []


def test_problems_are_sorted_by_line() -> None:
    text = "def task():\n    ask('a', 'b', [])\n    say(x)\n    go_to()\n    say(x)\n"
    assert [p.line for p in find_flaws(text)] == [None, 2, 3, 4, 5]


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["answer = 1", "say(anser)"], "the name anser is not defined; did you mean answer?"),
        (["is_in_rom('mug')"], "the name is_in_rom is not defined; did you mean is_in_room?"),
        (["goto('kitchen')"], "the name goto is not defined; did you mean go_to?"),
        (["pritn(1)"], "the name pritn is not defined; did you mean print?"),
        (["say(unheard_of)"], "the name unheard_of is not defined"),
    ],
)
def test_misspelt_name_gets_a_suggestion(lines: list[str], message: str) -> None:
    assert [flaw.message for flaw in find_flaws(in_task(*lines))] == [message]


def test_only_a_few_of_many_undefined_names_get_suggestions() -> None:
    bound = "".join(f"    name_{n}_bound = 1\n" for n in range(300))
    used = "".join(f"    say(name_{n}_bond)\n" for n in range(300))
    found = find_flaws(f"def task_program():\n{bound}{used}")
    assert len(found) == 300
    assert 0 < sum("did you mean" in flaw.message for flaw in found) <= 10


def test_a_ninth_skill_is_known() -> None:
    skills = SKILLS.with_skill(Skill("wave", (Parameter("hand"),), NO_VALUE, "Wave."))
    waves = in_task("wave()")
    (unknown,) = find_flaws(waves)
    assert (unknown.line, unknown.kind) == (2, "NameError")
    assert "wave" in unknown.message
    (lacks,) = find_flaws(waves, skills)
    assert "hand" in lacks.message


HOSTILE_SOURCES = {
    "signs": "-" * 100_000 + "1",
    "few signs": "-" * 1_000 + "1",
    "brackets": "(" * 1_000_000,
    "squares": "[" * 500,
    "attributes": "a." * 100_000 + "b",
    "few attributes": "a." * 900 + "b",
    "lambdas": "lambda:" * 50_000 + "1",
    "sums": "1+" * 100_000 + "1",
    "calls": "a" + "()" * 100_000,
    "else if": "if 1:pass\n" + "elif 1:pass\n" * 50_000,
    "blocks": "".join(" " * i + "if 1:\n" for i in range(200)) + " " * 200 + "pass",
    "null": TASK + "\0",
    "half a character": TASK + "'\ud800'",
    "digits": TASK + "9" * 10_000,
}


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(text, id=name, marks=[pytest.mark.slow] * (len(text) > 50_000))
        for name, text in HOSTILE_SOURCES.items()
    ],
)
def test_hostile_source_is_a_problem(text: str) -> None:
    assert find_flaws(text)
    assert find_flaws(in_task(text) if "\n" not in text else text)
    assert find_flaws(program_of(text).source)
    assert program_of(fence(text) + fence(TASK)).source


def test_string_annotations_are_never_parsed() -> None:
    annotations = (
        "x: '" + "(" * 10_000 + "' = 1\ny: '\\0' = 2\nz: '" + "-" * 9_000 + "1' = 1\nw: 'nowhere' = 1"
    )
    assert not find_flaws(f"{TASK}\n{annotations}\n")


# Frequent garbage collection runs Python code, so threads are often interrupted while they build a tree.
PARSE_IN_THREADS = """
import gc, sys
from concurrent.futures import ThreadPoolExecutor
from codebotler.core.program import parse

class Knot:
    def __init__(self):
        self.me = self
    def __del__(self):
        for _ in range(100):
            pass

def read(number):
    Knot()
    return len(parse(SOURCE).body)

SOURCE = "def task_program():\\n" + "".join(f"    say('{n}', [1, (2, {n} + {n} * 3)])\\n" for n in range(300))
sys.setswitchinterval(1e-6)
gc.set_threshold(5)
with ThreadPoolExecutor(4) as threads:
    print(sum(threads.map(read, range(60))))
"""


def test_threads_parse_at_the_same_time() -> None:
    ended = subprocess.run(
        [sys.executable, "-c", PARSE_IN_THREADS], capture_output=True, text=True, check=False, timeout=120
    )
    assert ended.stdout == "60\n", ended.stderr


CODE = r"""
import re
from codebotler.core.program import parse_expression, parse_program
from codebotler.core.world import World
parse_program("def task_program():\n    say('\\d' if 1 is 1 else '')\n", compiled=True)
parse_expression(r"'\d'")
re.compile("[[a] nested")
"""


def test_suspicious_escapes_and_regexes_cause_no_warning() -> None:
    ended = subprocess.run(
        [sys.executable, "-W", "error", "-c", CODE], capture_output=True, text=True, check=False, timeout=60
    )
    assert (ended.returncode, ended.stderr) == (0, "")


@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_process_forked_while_a_thread_parses_can_parse() -> None:
    locked, go_on = threading.Event(), threading.Event()

    def hold_the_lock() -> None:
        with program._PARSING:
            locked.set()
            go_on.wait(20)

    parsing = threading.Thread(target=hold_the_lock)
    parsing.start()
    assert locked.wait(20)
    threading.Timer(0.2, go_on.set).start()
    child = os.fork()
    if not child:
        signal.alarm(5)
        os._exit(len(program.parse("1").body) - 1)
    assert os.waitpid(child, 0)[1] == 0
    parsing.join()


def test_a_program_is_parsed_again_if_a_library_has_disturbed_it(monkeypatch: pytest.MonkeyPatch) -> None:
    disturbed = [SystemError("AST constructor recursion depth mismatch")]
    parse = ast.parse

    def parse_once_disturbed(source: str, name: str) -> ast.Module:
        if disturbed:
            raise disturbed.pop()
        return parse(source, name)

    monkeypatch.setattr(ast, "parse", parse_once_disturbed)
    assert len(program.parse("disturbed = 1").body) == 1
