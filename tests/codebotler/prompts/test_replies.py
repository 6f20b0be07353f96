"""Programs are found in the replies of many models, among thoughts, fences and chat templates."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codebotler.core.program import parse_leniently, task_definitions
from codebotler.prompts.extract import extract, read_reply

TASK = 'def task_program():\n    go_to("kitchen")\n    say("hello")\n'
BARE = TASK.rstrip("\n")
OTHER = 'def task_program():\n    say("other")\n'
BODY = '    go_to("kitchen")\n    say("hello")\n'
CUT_OFF = 'def task_program():\n    go_to("kitchen")\n    say("hel\n'
IN_DOCSTRING = (
    'def task_program():\n    """Greet.\n\n    ```\n    go_to("x")\n    ```\n    """\n    say("hello")\n'
)
IN_STRING = 'def task_program():\n    say("""\n```\ncode\n```\n""")\n'


def fence(code: str, info: str = "python", marks: str = "```") -> str:
    return f"{marks}{info}\n{code}{marks}\n"


def read(reply: str) -> tuple[str, str]:
    """Return the program and the reasoning, read in this process."""
    program, reasoning, _ = extract.function(reply)
    return program, reasoning


def source(reply: str) -> str:
    return read(reply)[0]


# --- several definitions


@pytest.mark.parametrize(
    "reply",
    [
        f"A draft:\n\n{OTHER}\nThis is better:\n\n{TASK}\nIt says hello.",
        f"{OTHER}\nOr better:\n{fence(TASK)}",
        f"{fence(OTHER)}\nOr better:\n\n{TASK}",
        f"def task_program():\n    pass\n\nFilled in, it is this:\n\n{TASK}",
        f"{fence('def task_program():' + chr(10) + '    ...' + chr(10))}\n{fence(TASK)}",
        f"{CUT_OFF}\n\n{TASK}",
        f"{TASK}\n\n# Shorter\n{CUT_OFF}",
        f"{fence(OTHER.replace('()', '(', 1))}Without the mistake:\n{fence(TASK)}",
        f"{fence(OTHER)}{fence(TASK)}To fill in:\n{fence(TASK[:20] + '    pass' + chr(10))}",
        f"{fence(OTHER)}{fence(TASK)}Run it:\n{fence('task_program()' + chr(10))}",
    ],
)
def test_last_complete_definition_counts(reply: str) -> None:
    assert source(reply) == TASK


def test_stub_before_the_real_definition_is_kept() -> None:
    both = f"def task_program():\n    pass\n\n\n{TASK}"
    assert source(f"{fence(OTHER)}\nOr better:\n{fence(both)}") == both


@pytest.mark.parametrize("joint", ["\n\n", "\n\n# A better one\n"])
def test_block_with_two_definitions_stays_whole_as_its_last_one_counts(joint: str) -> None:
    both = f"{OTHER}{joint}{TASK}"
    assert source(both) == both
    assert source(f"Here it is:\n{fence(both)}") == both


@pytest.mark.parametrize(
    "turn",
    [
        "<|im_end|>\n<|im_start|>user\nSay other<|im_end|>\n<|im_start|>assistant\n",
        "<|eot_id|><|start_header_id|>user<|end_header_id|>\n\nSay other<|eot_id|>",
        "</s>[INST] Say other [/INST]\n",
        "\nUser: Say other\n\nAssistant:\n",
        "\n<|user|>\nSay other\n<|assistant|>\n",
        "<end_of_turn>\n<start_of_turn>user\nSay other<end_of_turn>\n<start_of_turn>model\n",
    ],
)
def test_turn_that_the_model_wrote_for_its_user_ends_the_reply(turn: str) -> None:
    assert source(BARE + turn + OTHER) == TASK
    assert source(fence(TASK) + turn + fence(OTHER)) == TASK


def test_instruction_before_the_program_does_not_end_the_reply() -> None:
    assert source("[INST] Say hello in the kitchen. [/INST]\n" + TASK) == TASK


# --- fences


@pytest.mark.parametrize("program", [IN_DOCSTRING, IN_STRING])
@pytest.mark.parametrize("info", ["python", ""])
def test_fence_within_a_text_of_the_program_does_not_end_it(program: str, info: str) -> None:
    assert source(f"Here it is:\n{fence(program, info)}This is all of it.\n") == program
    assert source(f"Here it is:\n```{info}\n{program}") == program
    assert source(f"Here it is:\n{fence(program, info, '~~~')}This is all of it.\n") == program


def test_fence_in_a_docstring_is_kept_without_other_fences() -> None:
    assert source(f"Here it is for you:\n\n{IN_DOCSTRING}\nThis is all of it.\n") == IN_DOCSTRING


@pytest.mark.parametrize(
    ("closing", "closes"),
    [("```", True), ("   ```", True), ("````  ", True), ("    ```", False), ("~~~", False)],
)
def test_only_valid_closings_end_a_fence_of_cut_off_code(closing: str, closes: bool) -> None:  # noqa: FBT001 - pytest passes it
    program = source(f"```python\n{CUT_OFF}{closing}\nx = 1\n```\n")
    assert program == CUT_OFF if closes else program == f"{CUT_OFF}{closing}\nx = 1\n"


@pytest.mark.parametrize(
    "reply",
    [
        f"```markdown\n{fence(TASK)}```\n",
        f"```python\ndef task_program():\n    say('x'\n\nSorry, once more:\n\n{fence(TASK)}",
        "1. The program:\n\n    " + fence(TASK).replace("\n", "\n    ") + "\n2. It is done.\n",
        "- ```python\n  " + TASK.replace("\n", "\n  ") + "```\n",
        f"```python\n{BARE}```\nThis program says hello.\n",
        f"```python\n{BARE}```",
        f"{BARE}```",
        f"```python\n{OTHER.rstrip()}```\nOr better:\n```python\n{BARE}```\n",
        f"```python\n{BARE}```\nRun it:\n```\ntask_program()\n```\n",
    ],
)
def test_misplaced_fences_do_not_hide_the_program(reply: str) -> None:
    assert source(reply) == TASK


# --- thoughts

PAIRS = [
    ("<think>", "</think>"),
    ("<thinking>", "</thinking>"),
    ("<THINK>", "</Think>"),
    ("<think>", "</thinking>"),
    ("[THINK]", "[/THINK]"),
    ("<thought>", "</thought>"),
    ("<reasoning>", "</reasoning>"),
    ("<|START_THINKING|>", "<|END_THINKING|>"),
    ("<|begin_of_thought|>", "<|end_of_thought|>"),
    ("<\uff5cthink\uff5c>", "<\uff5c/think\uff5c>"),
    ("\u25c1think\u25b7", "\u25c1/think\u25b7"),
    ("<seed:think>", "</seed:think>"),
    ("<s><think>", "</think>"),
    ("<|im_start|>assistant\n<think>", "</think>"),
    ("<|channel|>analysis<|message|>", "<|end|><|start|>assistant<|channel|>final<|message|>"),
    ("<|channel>thought", "<channel|>"),
    ("<scratchpad>", "</scratchpad>"),
    ("<plan>", "</plan>"),
    ("<musing>", "</musing>"),
    ("[NOTES]", "[/NOTES]"),
]


@pytest.mark.parametrize(("first", "last"), PAIRS)
@pytest.mark.parametrize(
    ("thought", "joint"),
    [
        ("\nPerhaps:\n" + fence(OTHER) + "Or not.\n", "\n\nSo:\n"),
        ("\n" + OTHER, "\n"),
        ("\n" + OTHER.rstrip(), ""),
    ],
)
def test_thought_is_reasoning_and_never_the_program(first: str, last: str, thought: str, joint: str) -> None:
    assert read(f"{first}{thought}{last}{joint}{TASK}") == (TASK, thought.strip())
    if joint:
        assert read(f"{first}{thought}{last}{joint}{fence(CUT_OFF)}") == (CUT_OFF, thought.strip())


@pytest.mark.parametrize(("first", "last"), PAIRS[:10])
def test_thought_without_an_answer_is_not_a_program(first: str, last: str) -> None:
    assert read(f"{first}\n{fence(OTHER)}{last}\n") == ("\n", fence(OTHER).strip())
    assert read(f"{first}\n{fence(OTHER)}") == ("", fence(OTHER).strip())


@pytest.mark.parametrize("last", [last for _, last in PAIRS[:12]])
def test_thought_that_the_prompt_began_ends_where_its_last_marker_is(last: str) -> None:
    draft = f"Perhaps:\n{fence(OTHER)}That is it."
    assert read(f"{draft}{last}\n\n{fence(TASK)}") == (TASK, draft)
    assert read(f"{draft}\n{last}\n\n{fence(CUT_OFF)}") == (CUT_OFF, draft)
    assert read(f"{last}\n\n{fence(TASK)}") == (TASK, "")
    assert read(f"Perhaps:\n```python\n{OTHER}{last}\n\n{fence(TASK)}")[0] == TASK


@pytest.mark.parametrize(
    "reply",
    [
        f"<answer>\n{TASK}</answer>",
        f"<answer>{TASK}</answer>\nThis is all of it.",
        f"<plan>\nGo and speak.\n</plan>\n<answer>\n{fence(TASK)}</answer>",
        f"<think>Go.</think><answer>\n{TASK}</answer>",
        f"<code>\n{TASK}</code>\n",
        f"<|START_THINKING|>Go.<|END_THINKING|><|START_RESPONSE|>{TASK}<|END_RESPONSE|>",
        f"<|begin_of_solution|>\n{fence(TASK)}<|end_of_solution|>",
    ],
)
def test_pair_of_markers_around_the_answer_is_dropped(reply: str) -> None:
    assert source(reply) == TASK


# --- remains of chat templates


@pytest.mark.parametrize(
    "mark",
    [
        "[/INST]",
        "</s>",
        "<|im_end|>",
        "<|eot_id|>",
        "<\uff5cend\u2581of\u2581sentence\uff5c>",
        "<end_of_turn>",
        "<eos>",
    ],
)
def test_mark_of_a_chat_template_is_dropped(mark: str) -> None:
    for reply in (
        BARE + mark,
        f"{BARE} {mark}\n",
        f"{TASK}{mark}\n",
        f"{BARE}{mark}\n\nThis program says hello.\n",
        f"{TASK}{mark}\n\nThis program says hello.\n",
        f"Here is the program:\n\n{TASK}{mark}",
        f"```python\n{BARE}{mark}",
        f"```python\n{TASK}```{mark}\n",
        f"{mark}\n{TASK}",
        f"{mark} {TASK}",
    ):
        assert source(reply) == TASK


@pytest.mark.parametrize(
    "reply",
    [
        f"python\n{TASK}",
        f"Python\n\n{TASK}",
        f"assistant\n\n{TASK}",
        f"{TASK}assistant\n",
        f"{TASK}assistant\n\nThis program says hello.",
        f"Here is the program:\n\npython\n{TASK}",
        f"```\npython\n{TASK}```\n",
        f"[PYTHON]\n{TASK}[/PYTHON]",
        f"[PYTHON] {BARE} [/PYTHON]",
        f"[PYTHON]{BARE}[/PYTHON]",
        f"[PYTHON]\n{BODY}[/PYTHON]",
        f"Here is the program:\n\n[PYTHON]\n{TASK}[/PYTHON]\n\nThis program says hello.\n",
        f"<|im_start|>assistant\n{TASK}<|im_end|>",
        f"<|start_header_id|>assistant<|end_header_id|>\n\n{TASK}",
        f"<start_of_turn>model\n{TASK}",
        f"\ufeff{TASK}",
    ],
)
def test_residue_around_the_program_is_dropped(reply: str) -> None:
    assert source(reply) == TASK


@pytest.mark.parametrize("text", ["</s>", "[/INST]", "<|im_end|>", "python", "assistant", "<b>", "```"])
def test_text_of_the_program_is_not_dropped(text: str) -> None:
    program = (
        f'X = """\n{text}\n"""\n\n\ndef task_program():\n    say("{text}")\n    say("{text}")  # {text}\n'
    )
    assert source(program) == program
    assert source(f"Here it is:\n{fence(program, marks='````')}This is all of it.\n") == program


@pytest.mark.parametrize(
    "prose",
    [
        "This program says hello.",
        "\nThe robot goes there.\n\nThen it speaks; both can fail.",
        "\n(This assumes that the kitchen exists.)",
        '\n"Hello" is what it says.',
        "\ngo_to(room) moves the robot there.\nsay(text) then speaks.",
        "\nfor each room, the robot goes there.",
        "\nin this program, the robot goes there.",
        "\nNote: It says hello.",
        "\nExplanation:\n\n* go_to moves\n* say talks",
        "\nThe robot doesn't ask.",
    ],
)
def test_paragraph_after_a_program_without_fences_is_dropped(prose: str) -> None:
    assert source(TASK + prose) == TASK


# --- any reply

PIECES = [
    "Sure! Here it is:",
    "This program says hello.",
    "",
    "<think>",
    "</think>",
    "[THINK]",
    "[/THINK]",
    "<plan>",
    "</plan>",
    "<|im_end|>",
    "[/INST]",
    "</s>",
    "python",
    "assistant",
    "```",
    "```python",
    "    ```",
    "~~~",
    *TASK.split("\n"),
    *OTHER.split("\n"),
    *IN_STRING.split("\n"),
    "x = 1",
    "import time",
    "task_program()",
    "e\u0301",
]
REPLIES = st.lists(st.sampled_from(PIECES), max_size=14).map("\n".join)


@given(
    st.lists(st.sampled_from(["go_to('kitchen')", "say('</think>')", "say('''\n```\n''')", "x = 1  # </s>"]))
)
def test_fenced_program_is_found_unchanged(statements: list[str]) -> None:
    program = "\n".join(["def task_program():", "    pass", *(f"    {one}" for one in statements)]) + "\n"
    assert source(fence(program, marks="````")) == program
    assert source(f"<think>Perhaps.</think>\nSo:\n{fence(program, marks='````')}It is done.") == program


@given(REPLIES)
def test_program_is_found_again_in_itself(reply: str) -> None:
    program = source(reply)
    if task_definitions(parse_leniently(program)):
        assert source(program) == program


@given(REPLIES | st.text())
def test_any_reply_is_read(reply: str) -> None:
    for continues in (False, True):
        program, reasoning, _ = extract.function(reply, continues=continues)
        assert len(program) + len(reasoning) <= len(reply) + len("def task_program():\n") + len(reply)


def test_reply_is_read_in_one_form_of_unicode() -> None:
    reply = "<think>Cafe\u0301.</think>\ndef task_program():\n    go_to('cafe\u0301')\n"
    content = read_reply(reply)
    assert content.program == "def task_program():\n    go_to('caf\u00e9')\n"
    assert content.reasoning == "Caf\u00e9."
