"""Mutants: distinct by their trees, drawn evenly, and with a diff that a person can read."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from codebotler.badinput import BadInput
from codebotler.world import Room, World
from roboeval.mutation.mutants import Mutant, Original, drawn, mutants, originals
from roboeval.mutation.operator import Setting
from roboeval.mutation.operators import OPERATORS
from roboeval.mutation.variants import variants
from roboeval.suites.load import Suite, load_suite
from small_suite import a_suite

SETTING = Setting.of([World((Room("hall"), Room("lobby"), Room("kitchen")), "hall")])
GOES = 'def task_program():\n    go_to("lobby")\n    say("hello")\n'


def made(*programs: str) -> list[Mutant]:
    return list(mutants([Original(f"p{n}", program) for n, program in enumerate(programs)], SETTING))


def test_equal_mutants_are_one() -> None:
    again = "def task_program():  # another way to write it\n    go_to('lobby')\n    say('hello')\n"
    assert made(GOES, again) == made(GOES)
    texts = [mutant.program for mutant in made(GOES)]
    assert len(texts) == len(set(texts)) > 5


def test_a_mutant_that_is_another_right_program_is_none() -> None:
    other = GOES.replace('    go_to("lobby")\n', "")
    assert "drop-a-drive" in {mutant.operator for mutant in made(GOES)}
    assert "drop-a-drive" not in {m.operator for m in made(GOES, other) if m.original.name == "p0"}


@pytest.mark.parametrize(
    "program",
    ["def task_program(:\n", "def task_program():\n    break\n", "\0", "", "x = " + "1+" * 2_000 + "1"],
    ids=["does not parse", "does not compile", "null", "empty", "deep"],
)
def test_what_operators_cannot_read_has_no_mutants(program: str) -> None:
    assert [mutant for mutant in made(program) if mutant.program.count("+") < 1_000] == []
    assert made(program, GOES)[-1].original.program == GOES


def test_a_mutant_is_always_a_program() -> None:
    for mutant in made(GOES + "\ndef other():\n    for n in range(3):\n        return n\n"):
        compile(mutant.program, "mutant", "exec")


def test_a_diff_shows_what_was_changed() -> None:
    (mutant,) = (mutant for mutant in made(GOES) if mutant.operator == "forget-to-say")
    assert mutant.diff == "@@ -1,3 +1,2 @@\n def task_program():\n     go_to('lobby')\n-    say('hello')\n"


def test_mutants_are_drawn_evenly_and_by_the_seed() -> None:
    every = made(*(f'def task_program():\n    go_to("lobby")\n    say("{n}")\n' for n in range(20)))
    some = drawn(every, 60, seed=1)
    assert some == drawn(reversed(every), 60, seed=1)
    assert some != drawn(every, 60, seed=2)
    assert len(some) == len(set(some)) == 60
    drawn_of, all_of = (Counter(mutant.operator for mutant in those) for those in (some, every))
    level = max(drawn_of.values())
    assert all(drawn_of[name] >= min(all_of[name], level - 1) for name in all_of)


def test_no_more_are_drawn_than_there_are() -> None:
    every = made(GOES)
    assert Counter(drawn(every, 1_000, seed=3)) == Counter(every)


# --- right programs


def test_there_are_ten_right_programs_in_different_styles_for_each_task(paper: Suite) -> None:
    for task in paper.tasks.values():
        written = variants(task)
        assert len(written) >= 10, task.name
        assert len({variant.style for variant in written}) == len(written)
        texts = {Original(variant.name, variant.program).text for variant in written}
        assert len(texts) == len(written)


def test_originals_are_recorded_ones_variants_and_what_a_user_names(paper: Suite) -> None:
    further = (Original("mine", GOES, claimed=False), Original("again", GOES))
    found = originals(paper.tasks["SayGoodDay"], further)
    kinds = Counter(original.name.partition("/")[0] for original in found)
    assert kinds == {"recorded": 10, "right": 10, "mine": 1}


def test_every_operator_finds_something_to_do_in_the_right_programs(paper: Suite) -> None:
    idle = {operator.name: operator for operator in OPERATORS}
    for task in paper.tasks.values():
        setting = Setting.of([scenario.world for scenario in task.scenarios])
        for made in mutants(originals(task), setting, idle.copy().values()):
            idle.pop(made.operator, None)
    assert not idle


def test_a_suite_of_ones_own_has_right_programs_of_its_own(tmp_path: Path) -> None:
    task = load_suite(a_suite(tmp_path)).task("T")
    assert variants(task) == ()
    (tmp_path / "right" / "T").mkdir(parents=True)
    path = tmp_path / "right" / "T" / "01-short.py"
    path.write_text("# As short as can be.\ndef task_program(): go_to('kitchen')\n")
    (variant,) = variants(task)
    assert (variant.name, variant.style) == ("01-short", "As short as can be.")
    path.write_text("def task_program(): go_to('kitchen')\n")
    with pytest.raises(BadInput, match="style") as error:
        variants(task)
    assert (error.value.file, error.value.line) == (path, 1)
    path.write_bytes(b"# \xff\n")
    with pytest.raises(BadInput, match="cannot be read") as error:
        variants(task)
    assert error.value.file == path
