"""Shapes of programs, their similarity, and the shortest fix."""

import ast
from collections import Counter

import pytest

from codebotler.core.program import parse
from roboeval.analysis.failure_groups import (
    MAX_COMPARED_CHARACTERS,
    normalised_lines,
    passing_programs,
    similarity,
    smallest_difference,
)

ONE = """\
def task_program():
    'Go.'
    start = get_current_location()  # here
    go_to(start)
    for n in range(3):
        say(n)
"""
OTHER = """\
def task_program():
    'Go there.'
    here = get_current_location()
    go_to( here )

    for i in range(3):
        say(i)
"""


def test_names_comments_and_layout_do_not_change_the_shape() -> None:
    assert normalised_lines(ONE) == normalised_lines(OTHER)
    assert "    name1 = get_current_location()" in normalised_lines(ONE)
    assert normalised_lines(ONE) != normalised_lines(ONE.replace("range(3)", "range(4)"))
    assert normalised_lines(ONE) != normalised_lines(ONE.replace("say", "ask"))


def test_a_shape_leaves_the_parsed_program_as_it_is() -> None:
    program = f"{ONE}# parsed by no other test\n"
    before = ast.dump(parse(program))
    normalised_lines(program)
    assert ast.dump(parse(program)) == before


def test_different_names_stay_different() -> None:
    assert normalised_lines("a = 1\nb = 2\nsay(a)\n") == normalised_lines("x = 1\ny = 2\nsay(x)\n")
    assert normalised_lines("a = 1\nb = 2\nsay(a)\n") != normalised_lines("a = 1\nb = 2\nsay(b)\n")


def test_names_of_functions_and_arguments_do_not_change_the_shape() -> None:
    program = "def {0}({1}):\n    try:\n        go_to({1})\n    except Exception as {2}:\n        say({2})\n"
    assert normalised_lines(program.format("visit", "room", "error")) == normalised_lines(
        program.format("f", "x", "e")
    )


@pytest.mark.parametrize(
    "program",
    [
        "def task_program(:\n    go\n",
        "",
        "\0",
        "x" * (MAX_COMPARED_CHARACTERS + 1),
        "(" * 5_000,
        "-" * 5_000 + "1",
    ],
)
def test_any_text_has_a_shape(program: str) -> None:
    assert isinstance(normalised_lines(program), tuple)


def test_similarity_by_hand() -> None:
    one, other = Counter(["a", "b", "b", "c"]), Counter(["a", "b", "d"])
    assert similarity(one, other) == 2 * 2 / 7
    assert similarity(one, one) == 1.0
    assert similarity(Counter(), Counter()) == 1.0


def test_the_shortest_fix() -> None:
    wrong = "def task_program():\n    go_to('hall')\n    say('x')\n"
    near = wrong.replace("'x'", "'y'")
    far = "def task_program():\n    pass\n"
    fix = smallest_difference(wrong, passing_programs([("far", far), ("near", near), ("again", near)]))
    assert fix is not None
    assert (fix.name, fix.changed) == ("near", 2)
    assert fix.changes[-2:] == (("-", "    say('x')"), ("+", "    say('y')"))
    assert smallest_difference(wrong, {}) is None


def test_the_first_of_equally_near_programs_is_the_fix() -> None:
    fix = smallest_difference("a\nb\n", passing_programs([("one", "a\nc\n"), ("two", "a\nd\n")]))
    assert fix is not None
    assert fix.name == "one"


def test_lines_that_only_move_are_changes() -> None:
    fix = smallest_difference("a\nb\n", passing_programs([("moved", "b\na\n")]))
    assert fix is not None
    assert fix.changed == 2


def test_omitted_lines_of_a_difference_are_marked() -> None:
    lines = [f"line {n}" for n in range(30)]
    fix = smallest_difference("\n".join(lines), passing_programs([("p", "\n".join([*lines[:29], "other"]))]))
    assert fix is not None
    assert fix.changes[0] == (" ", "...")
    assert [sign for sign, _ in fix.changes] == [" ", " ", " ", "-", "+"]


def test_the_same_lines_in_another_order_may_be_further_than_other_lines() -> None:
    fix = smallest_difference(
        "a\nb\nc\n", passing_programs([("turned", "c\nb\na\n"), ("other", "a\nb\nd\n")])
    )
    assert fix is not None
    assert (fix.name, fix.changed) == ("other", 2)
