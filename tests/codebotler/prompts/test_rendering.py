import re
from dataclasses import replace
from difflib import SequenceMatcher

import pytest

from codebotler import prompts
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Parameter, Skill
from codebotler.core.skills.values import NO_VALUE
from codebotler.core.trace import Event, Option, Status
from codebotler.core.world import Person, Room, World
from codebotler.prompts import Prompt, PromptMessage, prompt_for, rendering, template_hash
from codebotler.prompts.extract import program_of
from codebotler.prompts.rendering import Example, examples, task_end
from codebotler.simulator import run
from flaws import find_flaws
from roboeval.suites.load import Suite

WAVE = Skill("wave", (Parameter("person"),), NO_VALUE, "Wave at a person in the room.")
PROMPT = prompt_for("Go to the lab.")


def room(name: str, *objects: str, people: tuple[Person, ...] = ()) -> Room:
    return Room(name, objects, people)


SCHOLAR = Person("omar", ("6", "8"))
LECTURER = Person("lena", ("no",))
EXPECTED = {
    "Drive to the greenhouse": (
        World((room("hall"), room("greenhouse")), "hall"),
        (Event("goto", "greenhouse"), Event("say", "the sprinklers start in ten minutes")),
    ),
    "The ladder belongs": (
        World((room("garage"), room("attic", "ladder"), room("boiler room")), "garage"),
        (
            Event("goto", "boiler room"),
            Event("check", "ladder", found=False),
            Event("goto", "garage"),
            Event("check", "ladder", found=False),
            Event("goto", "attic"),
            Event("check", "ladder", found=True),
            Event("pick", "ladder"),
            Event("goto", "boiler room"),
            Event("place", "ladder"),
        ),
    ),
    "Omar is studying": (
        World((room("hall"), room("library", people=(SCHOLAR,))), "hall"),
        (
            Event("goto", "library"),
            *(
                Event("ask", "how many legs does a spider have?", tuple(map(Option, ("6", "8", "10"))), said)
                for said in ("6", "8")
            ),
            Event("say", "well done, omar!"),
        ),
    ),
    "Say how many meeting": (
        World((room("meeting room a"), room("hall"), room("meeting room b")), "hall"),
        (Event("say", "there are 2 meeting rooms, and this is none of them"),),
    ),
    "A pallet should": (
        World((room("loading bay"), room("warehouse")), "warehouse"),
        (
            Event("goto", "loading bay"),
            *[Event("check", "pallet", found=False)] * 31,
            Event("goto", "warehouse"),
            Event("say", "the pallet is late"),
        ),
    ),
    "Find out from Lena": (
        World((room("storage room"), room("auditorium", "projector", people=(LECTURER,))), "storage room"),
        (
            Event("goto", "auditorium"),
            Event("ask", "do you still need the projector?", (Option("yes"), Option("no")), "no"),
            Event("pick", "projector"),
            Event("goto", "storage room"),
            Event("place", "projector"),
        ),
    ),
}


@pytest.mark.parametrize("example", examples(), ids=lambda example: example.instruction[:20])
def test_example_has_no_flaws_and_follows_its_instruction(example: Example) -> None:
    (known,) = (begins for begins in EXPECTED if example.instruction.startswith(begins))
    world, trace = EXPECTED[known]
    assert find_flaws(example.program) == ()
    outcome = run(example.program, world)
    assert outcome.status is Status.FINISHED, outcome.error
    assert outcome.trace == trace


def test_examples_are_enough_and_show_every_skill() -> None:
    assert len(examples()) >= 5
    called = {name for e in examples() for name in re.findall(r"\w+(?=\()", e.program)}
    assert set(SKILLS) <= called


def test_no_example_is_near_a_prompt_of_the_benchmark(paper: Suite) -> None:
    prompts = [prompt for task in paper.tasks.values() for prompt in task.prompts]
    assert len(prompts) == 80
    for example in examples():
        words = example.instruction.lower().split()
        for prompt in prompts:
            assert SequenceMatcher(a=words, b=prompt.lower().split(), autojunk=False).ratio() < 0.45, prompt


def texts(prompt: Prompt) -> tuple[str, str]:
    return "\n".join(message.text for message in prompt.messages), prompt.text


@pytest.mark.parametrize("skill", [*SKILLS.values(), WAVE], ids=lambda skill: skill.name)
def test_every_skill_of_the_table_is_in_both_prompts(skill: Skill) -> None:
    for text in texts(prompt_for("Go to the lab.", skills=SKILLS.with_skill(WAVE))):
        assert f'def {skill.signature}:\n    """{skill.doc}' in text


def test_skill_that_is_not_in_the_table_is_in_no_prompt() -> None:
    assert not any("wave" in text for text in texts(PROMPT))


def test_a_skill_that_is_left_out_is_in_no_prompt_nor_an_example() -> None:
    for text in texts(prompt_for("Go to the lab.", skills=SKILLS.without({"pick", "is_in_room"}))):
        assert not re.search(r"pick|is_in_room", text)
        assert "def place(" in text
        assert "Omar" in text, "an example without these skills stays"


def test_chat_begins_with_the_rules_shows_the_examples_and_ends_with_the_instruction() -> None:
    first, *shown, last = PROMPT.messages
    assert first.role == "system"
    assert [message.role for message in shown] == ["user", "assistant"] * len(examples())
    for question, answer, example in zip(shown[::2], shown[1::2], examples(), strict=True):
        assert question.text == example.instruction
        assert program_of(answer.text).source == example.program
    assert last == PromptMessage("user", "Go to the lab.")


def test_text_is_python_up_to_the_opening_and_holds_each_instruction_as_a_comment() -> None:
    assert PROMPT.text.endswith("# Instruction: Go to the lab.\ndef task_program():\n")
    assert find_flaws(PROMPT.text + "    pass\n") == ()
    for example in examples():
        assert f"# Instruction: {example.instruction}\n{example.program}" in PROMPT.text


@pytest.mark.parametrize(
    "instruction", ["Say $x and ${y} and {z}", 'Say """\nimport os\n"""', "a\n\nb", "Sag „grüß Gott“", "# a"]
)
def test_any_instruction_is_unchanged_and_stays_a_comment(instruction: str) -> None:
    prompt = prompt_for(instruction)
    assert prompt.messages[-1].text == instruction
    assert prompt.instruction == instruction
    tail = prompt.text.split("# Instruction: ")[-1]
    first, *more, _opening = tail.splitlines()
    assert [first, *(line.removeprefix("#").removeprefix(" ") for line in more)] == instruction.splitlines()
    assert find_flaws(prompt.text + "    pass\n") == ()


def test_prompt_lists_known_rooms() -> None:
    prompt = prompt_for("Go to the lab.", rooms=["lab", "alice's office"])
    for text in texts(prompt):
        assert "The rooms of this building are: lab, alice's office." in text
    assert not any("The rooms of this building" in text for text in texts(PROMPT))


def test_no_example_holds_a_stop_sequence_within_its_program() -> None:
    for example in examples():
        body = example.program.removeprefix(PROMPT.opening)
        assert body != example.program
        assert PROMPT.program_from(body) == example.program
        assert not any(stop in body for stop in PROMPT.stop)
    assert len(PROMPT.stop) <= 4


PROBLEMS = ['line 2: there is no room "lab"', "it waits for ever"]


def test_repair_carries_the_program_and_its_problems() -> None:
    program = "def task_program():\n    go_to('lab')\n"
    again = PROMPT.after(program, PROBLEMS)
    *before, answer, request = again.messages
    assert tuple(before) == PROMPT.messages
    assert (answer.role, request.role) == ("assistant", "user")
    assert program_of(answer.text).source == program
    for problem in PROBLEMS:
        assert f"- {problem}" in request.text
        assert f"# - {problem}" in again.text
    assert again.text.endswith("\n" + PROMPT.opening)
    assert find_flaws(again.text + "    pass\n") == ()
    assert (again.instruction, again.stop, again.opening) == (PROMPT.instruction, PROMPT.stop, PROMPT.opening)
    twice = again.after("def task_program():\n    go_to('hall')\n", ["a"])
    assert twice.text.count("\n" + PROMPT.opening) == PROMPT.text.count("\n" + PROMPT.opening)
    assert twice.text.index("go_to('lab')") < twice.text.index("go_to('hall')")


def test_repair_of_a_program_that_holds_a_fence_is_fenced_with_a_longer_one() -> None:
    program = 'def task_program():\n    say("""\n```\n""")\n'
    answer = PROMPT.after(program, ["a"]).messages[-2]
    assert answer.text.startswith("````python\n")
    assert program_of(answer.text).source == program


def test_hash_covers_all_but_the_instruction(monkeypatch: pytest.MonkeyPatch) -> None:
    before = template_hash()
    assert re.fullmatch("[0-9a-f]{64}", before)
    assert template_hash(SKILLS.with_skill(WAVE)) != before
    changes: dict[str, object] = {
        "STOP_TEXTS": ("\n#",),
        "OPENING": "def task_program() -> None:\n",
        "examples": lambda: examples()[1:],
        "_fence": lambda program: program,
    }
    for name, changed in changes.items():
        monkeypatch.setattr(rendering, name, changed)
        template_hash.cache_clear()
        assert template_hash() != before
        monkeypatch.undo()
    template_hash.cache_clear()
    assert template_hash() == before == prompts.template_hash()


OPENING = PROMPT.opening
BODY = '    go_to("lab")\n    say("hello")\n'


@pytest.mark.parametrize(
    "rest",
    [
        "",
        "\n\n# Instruction: Go home.\ndef task_program():\n    pass\n",
        "\n\ndef other():\n    pass\n",
        "\ntask_program()\n",
        "\n\nThat is all there is to it.\n",
        "```\nIt drives to the lab.",
        "\nif __name__ == '__main__':\n    task_program()\n",
    ],
)
def test_function_ends_where_something_else_begins(rest: str) -> None:
    assert PROMPT.program_from(BODY + rest).rstrip("\n") == (OPENING + BODY).rstrip("\n")


@pytest.mark.parametrize(
    "body",
    [
        "    options = [\n'a',\n]\n    say(options[0])\n",
        '    say("""\nfirst\nsecond""")\n    say("b")\n',
        "    # a\n# b\n    say('c')\n",
        "    say(\n'a'\n)\n    say('b')\n",
        "    if True:\n\n        say('a')\n\n    say('b')",
        "    say('cut o",
    ],
)
def test_function_continues_over_unindented_lines_that_belong_to_it(body: str) -> None:
    assert PROMPT.program_from(body) == OPENING + body


def test_reply_with_its_own_definition_is_kept_unchanged() -> None:
    for reply in (f"```python\n{OPENING}{BODY}```\n", OPENING + BODY, f"\nasync {OPENING}{BODY}"):
        assert PROMPT.program_from(reply) == reply


def test_end_of_a_huge_reply_is_found_at_once() -> None:
    huge = "    say((\n" + "a word\n" * 150_000
    assert task_end(OPENING, huge) == len(huge)
    assert task_end(OPENING, BODY + "done\n" * 200_000) == len(BODY) - 1


def test_equal_prompts_compare_equal() -> None:
    assert replace(PROMPT) == PROMPT
    assert prompt_for("Go to the lab.") == PROMPT
