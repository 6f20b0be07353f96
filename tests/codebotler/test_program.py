import pytest

from codebotler.models.recorded import NAMES, recorded_model
from codebotler.program import Problem, Program
from codebotler.reply import program_of
from codebotler.skills import SKILLS, Parameter, Skill

RECORDED = [
    reply for name in NAMES for them in recorded_model(f"recorded:{name}").replies.values() for reply in them
]
UNPARSABLE = {"SyntaxError", "IndentationError"}

TASK = 'def task_program():\n    go_to("kitchen")\n    say("hello")\n'
BODY = '    go_to("kitchen")\n    say("hello")\n'
CUT_OFF = 'def task_program():\n    go_to("kitchen")\n    say("hel'
HELPER = "def rooms():\n    return get_all_rooms()\n"
USES_HELPER = "def task_program():\n    for room in rooms():\n        go_to(room)\n"


def problems(text: str) -> list[tuple[int | None, str]]:
    return [(p.line, p.message) for p in Program(text).problems()]


def in_task(*statements: str) -> str:
    return "\n".join(["def task_program():", *("    " + s for s in statements)])


def fenced(code: str, info: str = "python", marks: str = "```") -> str:
    return f"{marks}{info}\n{code}{marks}\n"


def test_right_programs_have_no_problems() -> None:
    for reply in RECORDED:
        found = Program(reply.program).problems()
        if reply.fails is None:
            assert found == (), reply.about
        elif reply.fails in {*UNPARSABLE, "NameError", "AskEmptyOptions"}:
            assert reply.fails in {p.kind for p in found}, reply.about


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
        (
            "async def task_program():\n    pass",
            (1, "task_program is a coroutine, which nobody awaits"),
        ),
        (in_task("say(wish + wish)"), (2, "the name wish is not defined")),
        (in_task("help()"), (2, "the name help is not defined")),
        (in_task("say(__file__)"), (2, "the name __file__ is not defined")),
        (in_task("global n", "say(n)"), (3, "the name n is not defined")),
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
        "def help(): pass\n" + in_task("help()", "global say", "say('a')"),
        "n = 'a'\n" + in_task("global n", "say(n)"),
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
    assert program_of(text).problems()
    assert program_of(fenced(text) + fenced(TASK)).source


def test_lines_of_odd_characters() -> None:
    assert [p.line for p in Program(TASK + "'\ud800'").problems()] == [4]
    assert [p.line for p in Program(TASK + "\0").problems()] == [4]
