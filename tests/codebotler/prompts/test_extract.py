import ast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codebotler.core.program import undefined_names
from codebotler.core.skills.table import SkillTable
from codebotler.models.recorded import RECORDED_NAMES, open_recorded
from codebotler.prompts.extract import extract, program_of
from flaws import find_flaws

RECORDED = [
    reply
    for name in RECORDED_NAMES
    for them in open_recorded(f"recorded:{name}").replies.values()
    for reply in them
]
UNPARSABLE = {"SyntaxError", "IndentationError"}

TASK = 'def task_program():\n    go_to("kitchen")\n    say("hello")\n'
OTHER = 'def task_program():\n    say("other")\n'
BODY = '    go_to("kitchen")\n    say("hello")\n'
CUT_OFF = 'def task_program():\n    go_to("kitchen")\n    say("hel'
HELPER = "def rooms():\n    return get_all_rooms()\n"
USES_HELPER = "def task_program():\n    for room in rooms():\n        go_to(room)\n"


def source(reply: str, *, continues: bool = False) -> str:
    return program_of(reply, continues=continues).source


def in_task(*statements: str) -> str:
    return "\n".join(["def task_program():", *("    " + s for s in statements)])


def fence(code: str, info: str = "python", marks: str = "```") -> str:
    return f"{marks}{info}\n{code}{marks}\n"


@pytest.mark.parametrize("step", [10, pytest.param(1, marks=pytest.mark.slow)])
def test_recorded_programs_are_unchanged_alone_and_in_chat(step: int) -> None:
    for reply in RECORDED[::step]:
        program, once = reply.program, source(reply.program)
        assert source(once) == once
        if reply.fails not in UNPARSABLE:
            assert once.strip("\n") == program.strip("\n")
            assert source(f"Sure! Here it is:\n\n{fence(program)}\nIt goes there.\n") == once
            assert source(f"Sure, here it is:\n\n{program}\nThis program goes there and talks.\n") == once


@pytest.mark.parametrize(
    "reply",
    [
        TASK,
        "\n\n" + TASK + "\n\n",
        TASK.replace("\n", "\r\n"),
        fence(TASK),
        fence(TASK, "py"),
        fence(TASK, ""),
        fence(TASK, "Python title=x"),
        fence(TASK, marks="~~~"),
        fence(TASK, marks="````"),
        "```python\n" + TASK,
        "```python\n" + TASK + "\nThis program drives there.",
        "Here is the program:\n" + fence(TASK) + "It says hello (once).",
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
        "1. The program:\n   " + fence(TASK).replace("\n", "\n   "),
        "Install it:\n" + fence("pip install robot\n", "bash") + "Then:\n" + fence(TASK),
        fence(OTHER) + "Or better:\n" + fence(TASK),
        fence(TASK) + "Or better:\n" + fence(CUT_OFF + "\n").removesuffix("```\n"),
        fence(TASK) + "Call it:\n" + fence("task_program()\n"),
        "<think>\nPerhaps\n" + fence(OTHER) + "or not.\n</think>\n\n" + fence(TASK),
        "<think>" + OTHER + "</think>" + TASK,
        " <thinking>\n" + OTHER + "</thinking>\n" + BODY,
        OTHER + "\nThat may do.</think>\n\nHere it is:\n" + TASK,
        fence(TASK) + "<think>\n" + fence(OTHER) + "\nHm, ",
        "<THINK>\n" + OTHER + "</Think>\n" + TASK,
        "<think>They say </think>, and\n\n" + OTHER + "\nor not.\n</think>\n" + TASK,
        "<think>\nI will greet.</think>Here it is:\n" + fence(TASK),
        OTHER + "\nThat may do.</THINKING>\n" + fence(TASK) + "It thinks.\n</think>\n",
        fence(TASK) + "To fill in:\n" + fence('def task_program():\n    """Says it."""\n    ...\n'),
        fence("def task_program():\n    pass\n") + "Filled in:\n" + fence(TASK),
        BODY,
        BODY.lstrip(),
        fence(BODY),
        BODY + "```\nThis works.\n",
        TASK + "\n\n# Task: drive home\n# at once\ndef task_program():\n    go_to('ho",
        "Certainly\n\n" + TASK + "\nThis is all of it.\n",
    ],
)
def test_program_is_found_in_many_kinds_of_replies(reply: str) -> None:
    assert source(reply) == TASK


@pytest.mark.parametrize(
    "reply",
    [
        TASK,
        fence(TASK),
        BODY + "```\n\n# Task: say other\n" + fence(OTHER),
        TASK + "```\n\n# Task: say other\n" + fence(OTHER),
        BODY + "\n\n# Task: drive home\ndef task_program():\n    go_to('home')\n",
        TASK + "\n\n# Task: drive home\ndef task_program():\n    go_to('home')\n",
        BODY + "\n\nTask: drive home\ndef task_program():\n    go_to('home')\n",
        TASK + "\n\nTask: drive home\ndef task_program():\n    go_to('home')\n",
        fence(TASK) + "\n# Task: say other\n" + fence(OTHER),
        TASK + "\n\n# Task: drive home\n# at once\ndef task_program():\n    go_to('ho",
    ],
)
def test_first_program_of_a_base_model_counts(reply: str) -> None:
    assert source(reply, continues=True) == TASK


def test_code_without_a_definition_is_unchanged() -> None:
    assert source("1. Like this:\n   ```\n   go_to('home')\n   ```\n") == "go_to('home')\n"


def test_text_that_parses_is_not_prose() -> None:
    reply = "Here it is:\n\nrooms: list\n\n" + TASK + "\nThis is all of it.\n"
    assert source(reply) == "rooms: list\n\n" + TASK


def test_tabs_stay_tabs() -> None:
    body = "\tif is_in_room('mug'):\n\t\tpick('mug')\n\tsay('done')\n"
    assert source(body) == "def task_program():\n" + body
    assert source(body.lstrip()) == "def task_program():\n" + body


def test_body_that_begins_with_a_block_is_indented() -> None:
    body = "    if is_in_room('mug'):\n        pick('mug')\n    else:\n        say('no')\n"
    assert source(body.strip()) == "def task_program():\n" + body


def test_code_before_and_after_the_program_is_kept() -> None:
    constants = "import re\n\nX = 5  # comment\nA, B = (\n    1,\n    2,\n)\n"
    program = f"{constants}\n{HELPER}\n{USES_HELPER}\ntask_program()\n"
    assert source(program) == program
    assert source("Here you go:\n" + program + "\nIt needs some time.") == program


def test_text_that_looks_like_prose_or_fences_stays_in_a_string() -> None:
    program = 'def task_program():\n    say("""\nThis is a long text\n```\n# x\ndef task_program():\n""")\n'
    assert source(program) == program


def test_thought_without_an_answer_is_not_a_program() -> None:
    assert source("<think>\n" + fence(TASK)) == ""
    kept = 'def task_program():\n    say("""\n<think> is a tag, and so is\n</think>\n""")\n'
    assert source(kept) == kept


@pytest.mark.parametrize("tag", ["<think>", "</think>", "</THINK>"])
def test_a_tag_in_code_begins_and_ends_no_thought(tag: str) -> None:
    in_line = f"def task_program():\n    say('a {tag}')\n"
    alone = f'def task_program():\n    say("""\n{tag}\n""")\n'
    for code in (in_line, alone):
        assert source(f"<think>\nFirst:\n{fence(OTHER)}</think>\nSo:\n{fence(code)}Done.\n") == code
        assert source(f"So:\n{fence(code)}Done.\n") == code
        assert source(f"So:\n{fence(code)}".removesuffix("```\n")) == code
    assert source(f"Here it is:\n\n{in_line}\nThat is all of it.\n") == in_line


def test_an_outline_is_taken_if_there_is_nothing_else() -> None:
    outline = "def task_program():\n    pass\n"
    assert source("Here:\n" + fence(outline)) == outline


def test_other_blocks_are_added_only_if_needed() -> None:
    unused = "def unused():\n    pass\n"
    stub = "def go_to(room):\n    pass\n"
    needed = f"{HELPER}\n\n{USES_HELPER}"
    assert source(fence(HELPER) + "and\n" + fence(unused) + fence(stub) + fence(USES_HELPER)) == needed
    assert source(fence(USES_HELPER) + fence(HELPER)) == f"{USES_HELPER}\n\n{HELPER}"
    assert source(fence(HELPER) + fence("rooms = list\n") + fence(USES_HELPER)) == needed
    assert source(fence(HELPER + TASK) + fence(USES_HELPER)) == f"{HELPER}{TASK}\n\n{USES_HELPER}"
    newer = "def rooms():\n    return []\n"
    assert source(blocks(HELPER + TASK, newer, USES_HELPER)) == f"{newer}\n\n{USES_HELPER}"
    assert source(fence(USES_HELPER) + fence(HELPER + TASK)) == HELPER + TASK


def test_helpers_of_helpers_are_added() -> None:
    helper = "def rooms():\n    return ROOMS\n"
    expected = f"ROOMS = []\n\n\n{helper}\n\n{USES_HELPER}"
    assert source(fence("ROOMS = []\n") + fence(helper) + fence(USES_HELPER)) == expected


def blocks(*codes: str) -> str:
    return "and\n".join(fence(code) for code in codes)


CALLS_A = "def task_program():\n    a()\n"
USES_X = "def a():\n    say(x)\n"


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        pytest.param([CALLS_A, USES_X, "x = 1\n", "x = 2\n"], [0, 1, 2], id="the first definition is enough"),
        pytest.param(["x = 1\n", "x = 2\n", USES_X, CALLS_A], [0, 2, 3], id="also in front"),
        pytest.param(
            [CALLS_A, "say(y)\ndef a():\n    pass\n", "y = 1\n", "y = 2\n", "y = 3\n"],
            [0, 1, 2, 3, 4],
            id="none that comes too late is enough",
        ),
        pytest.param(
            ["y = 1\n", "say(y)\ndef a():\n    pass\n", CALLS_A, "y = 2\n"],
            [0, 1, 2],
            id="one in front of its use is enough",
        ),
        pytest.param([CALLS_A, "x = x\na = x\n", "x = 1\n"], [0, 1, 2], id="a block may not help itself"),
        pytest.param(
            ["x = 1\n", "def a():\n    say(x)\n    x = 2\n", CALLS_A, "x = 3\n"],
            [0, 1, 2, 3],
            id="no definition helps a local name used too early",
        ),
        pytest.param([CALLS_A, "x: int\na = 1\n", "x = 1\n"], [0, 1], id="who needs nothing gets nothing"),
        pytest.param(
            [CALLS_A, "def a():\n    say(x, b)\n", "x: int\n", "x = 1\n", "b = 2\n"],
            [0, 1, 2, 3, 4],
            id="an annotation is no definition",
        ),
        pytest.param(
            [
                "y = 0\n",
                CALLS_A + "    b()\n",
                "say(y)\ndef a():\n    pass\n",
                "b = 1\ny = 1\n",
                "y = 2\n",
            ],
            [0, 1, 2, 3],
            id="one in front is enough whichever comes along first",
        ),
        pytest.param(
            [
                "b = 1\ny = 0\n",
                CALLS_A + "    b()\n",
                "say(y)\ndef a():\n    c()\n",
                "c = 1\ny = 1\n",
                "y = 2\n",
            ],
            [0, 1, 2, 3],
            id="one in front stays enough",
        ),
        pytest.param(
            ["y = 0\n", "say(y)\ndef a():\n    c()\n", CALLS_A, "from m import *\nc = 1\n", "y = 2\n"],
            [0, 1, 2, 3],
            id="one in front is enough whatever comes from a star",
        ),
        pytest.param(
            ["c = x\n", CALLS_A, "def a():\n    global x\n    c\n", "x = 1\n"],
            [0, 1, 2],
            id="a global name is defined everywhere",
        ),
        pytest.param(
            [CALLS_A, "def a():\n    b()\n", "from m import *\ndef b():\n    c()\n", "c = 1\n"],
            [0, 1, 2],
            id="from a star may come whatever is lacking",
        ),
        pytest.param(
            [CALLS_A, "def a():\n    say(b, c)\n", "from m import *\nb = 1\n", "c = d\n", "d = 1\n"],
            [0, 1, 2, 3],
            id="also for later blocks",
        ),
        pytest.param(
            ["return 1\n" + CALLS_A + "x = 1\n", USES_X, "x = 2\n"],
            [0, 1],
            id="a program that does not compile defines names",
        ),
        pytest.param([CALLS_A, "a = 1\nreturn\n", "a = 2\n"], [0, 2], id="a helper has to compile"),
    ],
)
def test_only_these_blocks_are_added(given: list[str], kept: list[int]) -> None:
    assert source(blocks(*given)) == "\n\n".join(given[i] for i in kept)


def test_work_grows_no_faster_than_the_reply(monkeypatch: pytest.MonkeyPatch) -> None:
    read = []

    def count(tree: ast.Module, skills: SkillTable) -> list[tuple[int, str, bool]]:
        read.append(sum(1 for _ in ast.walk(tree)))
        return undefined_names(tree, skills)

    def work(number: int) -> int:
        read.clear()
        chain = [f"def f{i}():\n    return f{i + 1}()\n" for i in range(number)]
        assert extract.function(blocks(USES_HELPER, "rooms = f0\n", *chain))[0].startswith(USES_HELPER)
        return sum(read)

    monkeypatch.setattr("codebotler.prompts.extract.undefined_names", count)
    assert work(80) < 10 * work(10)


def test_no_text_of_a_reply_is_parsed_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    texts: list[str] = []
    parse = ast.parse

    def count(text: str, name: str) -> ast.Module:
        texts.append(text)
        return parse(text, name)

    monkeypatch.setattr(ast, "parse", count)

    for reply in (
        TASK,
        BODY,
        BODY.lstrip(),
        f"Here it is for you:\n\n{fence(TASK)}\nIt drives there.\nThen it speaks.\n",
    ):
        new = reply.replace("hello", "good day")  # No other test parses this.
        texts.clear()
        extract.function(new)
        assert 0 < len(texts) == len(set(texts))


@pytest.mark.parametrize(
    "reply",
    [
        CUT_OFF,
        fence(CUT_OFF + "\n"),
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
    program = program_of(reply)
    if "Dear all" not in reply:  # In that one, text that may be prose is dropped, and the string stays open.
        assert program.source.rstrip("\n").endswith(reply.rstrip("`\n").rsplit("\n", 1)[-1])
    if "is_in" not in reply:
        assert [p.kind for p in find_flaws(program.source)] == ["SyntaxError"]


@given(st.sampled_from([r.program for r in RECORDED if r.fails is None]), st.integers(0, 2000))
def test_nothing_is_lost_wherever_a_program_is_cut(program: str, at: int) -> None:
    cut = program[:at]
    if "def task_program" in cut:
        assert source(cut).strip() == cut.strip()
        assert source("```python\n" + cut).strip() == cut.strip()


def test_broken_code_before_the_program_is_kept() -> None:
    reply = "def helper(:\n    return 1\n\n" + TASK
    assert source(reply) == reply


@pytest.mark.parametrize(
    "reply", ["", "\n", "I cannot do that.", "Sorry:\n    - no\n", "   Sorry, I cannot.\n"]
)
def test_reply_without_code_is_the_source(reply: str) -> None:
    assert source(reply) == reply
    assert find_flaws(program_of(reply).source)


@given(st.text(alphabet=st.sampled_from("`~ \n\t#a(=:\"'\0\ud800é"), max_size=60) | st.text())
def test_any_text_is_read_without_an_error(text: str) -> None:
    program = program_of(text)
    assert isinstance(find_flaws(program.source), tuple)
    assert isinstance(find_flaws(text), tuple)
