import pytest

from codebotler.core.program import Program
from codebotler.core.skills import SKILLS, Parameter, Skill
from codebotler.models.recorded import NAMES, recorded_model
from codebotler.prompts.extract import program_of

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
    ("text", "line", "named"),
    [
        ("def task_program(:\n    pass", 1, ["parse", "invalid syntax"]),
        ("def task_program():\n    pass\nreturn", 3, ["parse", "'return' outside function"]),
        ("def other():\n    pass", None, ["task_program"]),
        ("class A:\n    def task_program(self):\n        pass", None, ["task_program", "module level"]),
        ("def task_program(robot, *, now, x=1):\n    pass", 1, ["task_program", "robot and now"]),
        ("async def task_program():\n    pass", 1, ["task_program", "coroutine"]),
        (in_task("say(wish + wish)"), 2, ["name wish"]),
        (in_task("help()"), 2, ["name help"]),
        (in_task("say(__file__)"), 2, ["name __file__"]),
        (in_task("global n", "say(n)"), 3, ["name n "]),
        (in_task("x += 1"), 2, ["name x "]),
        (in_task("say(x)", "x = 'a'") + "\nx = 'b'", 2, ["local variable x "]),
        (in_task("say = say('a')"), 2, ["local variable say "]),
        (in_task("x = 1", "ask('a', 'b')"), 3, ["ask", "person, question and options", "2 arguments"]),
        (in_task("go_to()"), 2, ["go_to", "location", "no argument"]),
        (in_task("get_all_rooms(1)"), 2, ["get_all_rooms", "no arguments", "1 argument"]),
        (in_task("pick(item='a')"), 2, ["pick", "obj", "item"]),
        (in_task("pick('a', obj='a')"), 2, ["pick", "obj", "twice"]),
        (in_task("ask('a', 'b', [])"), 2, ["options of ask", "empty list"]),
        (in_task("ask('a', 'b', options=[])"), 2, ["options of ask", "empty list"]),
        (in_task("ask('a', 'b', ['a',", "  3])"), 3, ["options of ask", "strings", "value 3"]),
        (in_task("ask('a', 'b', [['a']])"), 2, ["options of ask", "strings", "a list"]),
        (in_task("ask('a', 'b', ('a',))"), 2, ["options of ask", "a list", "a tuple"]),
        (in_task("ask('a', 'b', 'c')"), 2, ["options of ask", "a list", "a string"]),
        (in_task("ask('a', 'b', {})"), 2, ["options of ask", "a list", "a dictionary"]),
        (in_task("ask('a', 'b', {'a'})"), 2, ["options of ask", "a list", "a set"]),
        (in_task("ask('a', 'b', None)"), 2, ["options of ask", "a list", "None"]),
    ],
)
def test_problem(text: str, line: int | None, named: list[str]) -> None:
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
    (unknown,) = program.problems()
    assert (unknown.line, unknown.kind) == (2, "NameError")
    assert "wave" in unknown.message
    (lacks,) = program.problems(skills)
    assert "hand" in lacks.message


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
