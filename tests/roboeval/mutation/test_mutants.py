"""Mutants: distinct by their trees, sampled evenly, and with a diff that a person can read."""

from __future__ import annotations

from collections import Counter

import pytest

from codebotler.core.world import Room, World
from roboeval.mutation.mutants import MUTATION_OPERATORS, Mutant, Original, mutants, originals, sample_mutants
from roboeval.mutation.operator import Context, operators_in
from roboeval.mutation.operators import misuse
from roboeval.suites.load import Suite

CONTEXT = Context.of([World((Room("hall"), Room("lobby"), Room("kitchen")), "hall")])
GOES = 'def task_program():\n    go_to("lobby")\n    say("hello")\n'


def make_mutants(*programs: str) -> list[Mutant]:
    return list(mutants([Original(f"p{n}", program) for n, program in enumerate(programs)], CONTEXT))


def test_equal_mutants_are_listed_once() -> None:
    again = "def task_program():  # another way to write it\n    go_to('lobby')\n    say('hello')\n"
    assert make_mutants(GOES, again) == make_mutants(GOES)
    texts = [mutant.program for mutant in make_mutants(GOES)]
    assert len(texts) == len(set(texts)) > 5


def test_a_mutant_that_equals_another_right_program_is_dropped() -> None:
    other = GOES.replace('    go_to("lobby")\n', "")
    assert "drop-a-drive" in {mutant.operator for mutant in make_mutants(GOES)}
    assert "drop-a-drive" not in {m.operator for m in make_mutants(GOES, other) if m.original.name == "p0"}


@pytest.mark.parametrize(
    "program",
    ["def task_program(:\n", "def task_program():\n    break\n", "\0", "", "x = " + "1+" * 2_000 + "1"],
    ids=["does not parse", "does not compile", "null", "empty", "deep"],
)
def test_a_program_that_operators_cannot_read_has_no_mutants(program: str) -> None:
    assert [mutant for mutant in make_mutants(program) if mutant.program.count("+") < 1_000] == []
    assert make_mutants(program, GOES)[-1].original.program == GOES


def test_a_mutant_is_always_a_program() -> None:
    for mutant in make_mutants(GOES + "\ndef other():\n    for n in range(3):\n        return n\n"):
        compile(mutant.program, "mutant", "exec")


def test_a_diff_shows_what_was_changed() -> None:
    (mutant,) = (mutant for mutant in make_mutants(GOES) if mutant.operator == "forget-to-say")
    assert mutant.diff == "@@ -1,3 +1,2 @@\n def task_program():\n     go_to('lobby')\n-    say('hello')\n"


def test_mutants_are_sampled_evenly_and_by_the_seed() -> None:
    every = make_mutants(*(f'def task_program():\n    go_to("lobby")\n    say("{n}")\n' for n in range(20)))
    some = sample_mutants(every, 60, seed=1)
    assert some == sample_mutants(reversed(every), 60, seed=1)
    assert some != sample_mutants(every, 60, seed=2)
    assert len(some) == len(set(some)) == 60
    drawn_of, all_of = (Counter(mutant.operator for mutant in those) for those in (some, every))
    level = max(drawn_of.values())
    assert all(drawn_of[name] >= min(all_of[name], level - 1) for name in all_of)


def test_at_most_all_mutants_are_sampled() -> None:
    every = make_mutants(GOES)
    assert Counter(sample_mutants(every, 1_000, seed=3)) == Counter(every)


# --- originals


@pytest.mark.slow
def test_originals_are_right_solutions_and_named_programs(paper: Suite) -> None:
    further = (Original("mine", GOES, declared_right=False), Original("again", GOES))
    for task in paper.tasks.values():
        found = originals(task, further)
        assert len({original.name for original in found}) == len(found) > 15, task.name
        assert found[-1].name == "mine"


@pytest.mark.slow
def test_every_operator_applies_to_some_right_program(paper: Suite) -> None:
    idle = {operator.name: operator for operator in MUTATION_OPERATORS}
    for task in paper.tasks.values():
        context = Context.of([scenario.world for scenario in task.scenarios])
        for made in mutants(originals(task), context, idle.copy().values()):
            idle.pop(made.operator, None)
    assert set(idle) == {operator.name for operator in operators_in(misuse)}  # The suite lacks custom skills.
