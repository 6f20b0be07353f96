from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

import codebotler
from codebotler.program import Problem, Program
from codebotler.skills import SKILLS, Parameter, Skill

RECORDED = Path(codebotler.__file__).parent / "models" / "recorded"
UNPARSABLE = {"SyntaxError", "IndentationError"}

TASK = 'def task_program():\n    go_to("kitchen")\n    say("hello")\n'
BODY = '    go_to("kitchen")\n    say("hello")\n'
CUT_OFF = 'def task_program():\n    go_to("kitchen")\n    say("hel'
HELPER = "def rooms():\n    return get_all_rooms()\n"
USES_HELPER = "def task_program():\n    for room in rooms():\n        go_to(room)\n"


def recorded() -> list[Any]:
    rows = [
        (path, reply)
        for path in sorted(RECORDED.glob("*/*.yaml"))
        for entry in yaml.safe_load(path.read_text())
        for reply in entry["replies"]
    ]
    return [
        pytest.param(r["program"], r["fails"], id=f"{p.parent.name}-{p.stem}-{r['about']}") for p, r in rows
    ]


def source(reply: str) -> str:
    return Program.from_reply(reply).source


def problems(text: str) -> list[tuple[int | None, str]]:
    return [(p.line, p.message) for p in Program(text).problems()]


def in_task(*statements: str) -> str:
    return "\n".join(["def task_program():", *("    " + s for s in statements)])


def fenced(code: str, info: str = "python", marks: str = "```") -> str:
    return f"{marks}{info}\n{code}{marks}\n"


# --- replies


@pytest.mark.parametrize(("program", "fails"), recorded())
def test_recorded_programs_stay_as_they_are(program: str, fails: str | None) -> None:
    once = source(program)
    assert source(once) == once
    if fails not in UNPARSABLE:
        assert once.strip("\n") == program.strip("\n")


@pytest.mark.parametrize(("program", "fails"), recorded())
def test_recorded_programs_survive_chat(program: str, fails: str | None) -> None:
    if fails not in UNPARSABLE:
        assert source(f"Sure! Here it is:\n\n{fenced(program)}\nIt goes there.\n") == source(program)
        assert source(f"Sure, here it is:\n\n{program}\nThis program goes there and talks.\n") == source(
            program
        )


@pytest.mark.parametrize(
    "reply",
    [
        TASK,
        "\n\n" + TASK + "\n\n",
        TASK.replace("\n", "\r\n"),
        fenced(TASK),
        fenced(TASK, "py"),
        fenced(TASK, ""),
        fenced(TASK, "Python title=x"),
        fenced(TASK, marks="~~~"),
        fenced(TASK, marks="````"),
        "```python\n" + TASK,
        "```python\n" + TASK + "\nThis program drives there.",
        "Here is the program:\n" + fenced(TASK) + "It says hello (once).",
        "Here is the program:\n\n" + TASK + "\nThis program says hello\nand (of course) goes there.\n",
        " Here is the program:\n\n" + TASK,
        "Here's a program that\n(hopefully) works:\n" + TASK,
        "Sure!\n\n" + TASK + "\nDone, as you wished",
        "**Program**\n\n" + TASK + "\n**Explanation**\n\n1. The robot drives.\n2. It says hello.\n   Once.\n",
        TASK + "```\nThis works.\n",
        TASK + "</code>\n",
        TASK + "\nExplanation:\n- drives to the kitchen\n- `say` speaks\n",
        "以下是程序：\n\n" + TASK + "\n它会说你好。\n",  # noqa: RUF001 - Chinese prose
        "  " + TASK.replace("\n", "\n  ").rstrip(" "),
        "Like this:\n\n    " + TASK.replace("\n", "\n    ").rstrip(" ") + "\nThat is all.\n",
        "1. The program:\n   " + fenced(TASK).replace("\n", "\n   "),
        "Install it:\n" + fenced("pip install robot\n", "bash") + "Then:\n" + fenced(TASK),
        fenced(TASK) + "Or shorter:\n" + fenced('def task_program():\n    say("other")\n'),
        BODY,
        BODY.lstrip(),
        fenced(BODY),
        BODY + "```\nThis works.\n",
        BODY + "\n\n# Task: drive home\ndef task_program():\n    go_to('home')\n",
        TASK + "\n\n# Task: drive home\n# at once\ndef task_program():\n    go_to('ho",
        TASK + "\n\nTask: drive home\ndef task_program():\n    go_to('home')\n",
    ],
)
def test_one_program_in_many_dresses(reply: str) -> None:
    assert source(reply) == TASK


def test_tabs_stay_tabs() -> None:
    body = "\tif is_in_room('mug'):\n\t\tpick('mug')\n\tsay('done')\n"
    assert source(body) == "def task_program():\n" + body
    assert source(body.lstrip()) == "def task_program():\n" + body


def test_body_whose_first_line_opens_a_block() -> None:
    body = "    if is_in_room('mug'):\n        pick('mug')\n    else:\n        say('no')\n"
    assert source(body.strip()) == "def task_program():\n" + body


def test_code_in_front_and_behind_stays() -> None:
    constants = "import re\n\nX = 5  # comment\nA, B = (\n    1,\n    2,\n)\n"
    program = f"{constants}\n{HELPER}\n{USES_HELPER}\ntask_program()\n"
    assert source(program) == program
    assert source("Here you go:\n" + program + "\nIt needs some time.") == program


def test_text_that_looks_like_prose_or_fences_stays_in_a_string() -> None:
    program = 'def task_program():\n    say("""\nThis is a long text\n```\n# x\ndef task_program():\n""")\n'
    assert source(program) == program


def test_other_blocks_come_along_only_where_needed() -> None:
    unused = "def unused():\n    pass\n"
    stub = "def go_to(room):\n    pass\n"
    needed = f"{HELPER}\n\n{USES_HELPER}"
    assert source(fenced(HELPER) + "and\n" + fenced(unused) + fenced(stub) + fenced(USES_HELPER)) == needed
    assert source(fenced(USES_HELPER) + fenced(HELPER)) == f"{USES_HELPER}\n\n{HELPER}"
    assert source(fenced(HELPER + TASK) + fenced(USES_HELPER)) == HELPER + TASK
    assert source(fenced(USES_HELPER) + fenced(HELPER + TASK)) == USES_HELPER


def test_helpers_of_helpers_come_along() -> None:
    helper = "def rooms():\n    return ROOMS\n"
    expected = f"ROOMS = []\n\n\n{helper}\n\n{USES_HELPER}"
    assert source(fenced("ROOMS = []\n") + fenced(helper) + fenced(USES_HELPER)) == expected


@pytest.mark.parametrize(
    "reply",
    [
        CUT_OFF,
        fenced(CUT_OFF + "\n"),
        "```python\n" + CUT_OFF,
        "Here you go:\n\n" + CUT_OFF,
        TASK + "\ndef helper(a,",
        TASK + '\nMESSAGES = ["a",',
        TASK + "\nx = ",
        TASK + "    if is_in",
        'def task_program():\n    say("""Dear all,\nThis is a message for you',
        "    go_to('kitchen')\n    say('hel",
    ],
)
def test_cut_off_stays_cut_off(reply: str) -> None:
    program = Program.from_reply(reply)
    if "Dear all" not in reply:  # there, what may be prose is dropped, and the string stays open
        assert program.source.rstrip("\n").endswith(reply.rstrip("`\n").rsplit("\n", 1)[-1])
    if "is_in" not in reply:
        assert [p.kind for p in program.problems()] == ["SyntaxError"]


@given(st.sampled_from([str(p.values[0]) for p in recorded() if p.values[1] is None]), st.integers(0, 2000))
def test_nothing_is_lost_wherever_a_program_is_cut(program: str, at: int) -> None:
    cut = program[:at]
    if "def task_program" in cut:
        assert source(cut).strip() == cut.strip()
        assert source("```python\n" + cut).strip() == cut.strip()


def test_broken_code_in_front_is_no_prose() -> None:
    reply = "def helper(:\n    return 1\n\n" + TASK
    assert source(reply) == reply


@pytest.mark.parametrize(
    "reply", ["", "\n", "I cannot do that.", "Sorry:\n    - no\n", "   Sorry, I cannot.\n"]
)
def test_reply_without_code_is_the_source(reply: str) -> None:
    assert source(reply) == reply
    assert Program.from_reply(reply).problems()


@given(st.text(alphabet=st.sampled_from("`~ \n\t#a(=:\"'\0\ud800é"), max_size=60) | st.text())
def test_any_reply_and_any_source_is_taken(text: str) -> None:
    program = Program.from_reply(text)
    assert isinstance(program.problems(), tuple)
    assert isinstance(Program(text).problems(), tuple)


# --- problems


@pytest.mark.parametrize(("program", "fails"), recorded())
def test_right_programs_have_no_problems(program: str, fails: str | None) -> None:
    found = Program(program).problems()
    if fails is None:
        assert found == ()
    elif fails in {*UNPARSABLE, "NameError", "AskEmptyOptions"}:
        assert fails in {p.kind for p in found}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("def task_program(:\n    pass", (1, "the program does not parse: invalid syntax")),
        (
            "def task_program():\n    pass\nreturn",
            (3, "the program does not parse: 'return' outside function"),
        ),
        ("def other():\n    pass", (None, "the program defines no task_program at module level")),
        (
            "class A:\n    def task_program(self):\n        pass",
            (None, "the program defines no task_program at module level"),
        ),
        (
            "def task_program(robot, *, now, x=1):\n    pass",
            (1, "task_program takes robot and now, but it is called without arguments"),
        ),
        (in_task("say(wish)"), (2, "the name wish is not defined")),
        (in_task("x += 1"), (2, "the name x is not defined")),
        (
            in_task("say(x)", "x = 'a'") + "\nx = 'b'",
            (2, "the local variable x is used before it has a value"),
        ),
        (in_task("say = say('a')"), (2, "the local variable say is used before it has a value")),
        (
            in_task("x = 1", "ask('a', 'b')"),
            (3, "ask takes person, question and options, but 2 arguments are given"),
        ),
        (in_task("go_to()"), (2, "go_to takes location, but no argument is given")),
        (in_task("get_all_rooms(1)"), (2, "get_all_rooms takes no arguments, but 1 argument is given")),
        (in_task("pick(item='a')"), (2, "pick takes obj, but an argument named item is given")),
        (in_task("pick('a', obj='a')"), (2, "pick takes obj, but obj is given twice")),
        (in_task("ask('a', 'b', [])"), (2, "the options of ask are an empty list")),
        (in_task("ask('a', 'b', options=[])"), (2, "the options of ask are an empty list")),
        (
            in_task("ask('a', 'b', ['a',", "  3])"),
            (3, "the options of ask must be strings, but the value 3 is among them"),
        ),
        (
            in_task("ask('a', 'b', [['a']])"),
            (2, "the options of ask must be strings, but a list is among them"),
        ),
        (in_task("ask('a', 'b', ('a',))"), (2, "the options of ask must be a list, but a tuple is given")),
        (in_task("ask('a', 'b', 'c')"), (2, "the options of ask must be a list, but a string is given")),
        (in_task("ask('a', 'b', {})"), (2, "the options of ask must be a list, but a dictionary is given")),
        (in_task("ask('a', 'b', {'a'})"), (2, "the options of ask must be a list, but a set is given")),
        (
            in_task("ask('a', 'b', None)"),
            (2, "the options of ask must be a list, but the value None is given"),
        ),
    ],
)
def test_problem(text: str, expected: tuple[int | None, str]) -> None:
    assert problems(text) == [expected]


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
def test_no_problem(text: str) -> None:
    assert problems(text) == []


def test_problems_stand_in_the_order_of_lines() -> None:
    text = "def task():\n    ask('a', 'b', [])\n    say(x)\n    go_to()\n    say(x)\n"
    assert [p.line for p in Program(text).problems()] == [None, 2, 3, 4, 5]


def test_a_ninth_skill_is_known() -> None:
    skills = SKILLS.with_skill(Skill("wave", (Parameter("hand"),), "None", "Wave."))
    program = Program(in_task("wave()"))
    assert program.problems() == (Problem(2, "NameError", "the name wave is not defined"),)
    assert [p.message for p in program.problems(skills)] == ["wave takes hand, but no argument is given"]


DEEP = {
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
    "annotation": TASK + "x: '" + "(" * 10_000 + "' = 1\ny: '\\0' = 2\nz: '" + "-" * 9_000 + "1' = 1",
}


@pytest.mark.parametrize("text", DEEP.values(), ids=DEEP)
def test_hostile_source_is_a_problem(text: str) -> None:
    assert Program(text).problems()
    assert Program(in_task(text) if "\n" not in text else text).problems()
    assert Program.from_reply(text).problems()
    assert Program.from_reply(fenced(text) + fenced(TASK)).source


def test_lines_of_odd_characters() -> None:
    assert [p.line for p in Program(TASK + "'\ud800'").problems()] == [4]
    assert [p.line for p in Program(TASK + "\0").problems()] == [4]
