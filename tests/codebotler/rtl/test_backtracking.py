"""No text of a program makes the judge slow: its regexes and functions take linear time."""

import ast
import importlib
import pkgutil
import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import codebotler.rtl
import codebotler.simulator.worlds.robot
from codebotler.rtl import Claim, Number, Time
from codebotler.rtl.reasoning.backtracking import (
    UNITS,
    RepeatedText,
    is_slow,
    slow_text,
    texts_to_try,
)
from codebotler.rtl.text.clauses import clauses, sentences
from codebotler.rtl.text.numbers import numerals
from codebotler.rtl.text.polarity import polarity
from codebotler.rtl.text.times import times_in
from roboeval.linting.task_findings import searched_regexes
from roboeval.suites.load import load_suite

Read = Callable[[str], object]
METHODS = ("match", "fullmatch", "search", "finditer", "sub", "split")
MODULES = [
    *(
        importlib.import_module(one.name)
        for one in pkgutil.walk_packages(codebotler.rtl.__path__, "codebotler.rtl.")
    ),
    codebotler.simulator.worlds.robot,
]


def judge_regexes() -> Iterator[tuple[str, str, Read]]:
    """Yield every regex of the judge's modules, once for each method that they call on it."""
    for module in MODULES:
        tree = ast.parse(Path(str(module.__file__)).read_text())
        used: dict[str, set[str]] = {}
        for node in ast.walk(tree):
            match node:
                case ast.Attribute(ast.Name(name), method) if method in METHODS:
                    used.setdefault(name, set()).add(method)
        for name, value in vars(module).items():
            if isinstance(value, re.Pattern):
                for method in sorted(used.get(name, {"search"})):
                    yield f"{module.__name__}.{name}.{method}", value.pattern, bind_method(value, method)


def bind_method(pattern: re.Pattern[str], method: str) -> Read:
    match method:
        case "finditer":
            return pattern.findall
        case "sub":
            return partial(pattern.sub, " ")
    read: Read = getattr(pattern, method)
    return read


def find_slow(read: Read, texts: list[RepeatedText], *most: Any) -> RepeatedText | None:  # noqa: ANN401 - any limits
    return next((text for text in texts if is_slow(read, text, *most)), None)


@pytest.mark.slow
def test_regexes_of_the_judge_take_linear_time() -> None:
    found = {name: find_slow(read, texts_to_try(pattern)[:10]) for name, pattern, read in judge_regexes()}
    assert len(found) > 20
    assert not {name: text for name, text in found.items() if text is not None}


FUNCTIONS: dict[str, Read] = {
    "numerals": lambda text: [*numerals(text)],
    "times_in": times_in,
    "sentences": sentences,
    "clauses": clauses,
    "gathered clauses": partial(clauses, lists=True),
    "polarity": polarity,
    "number": Number(2, "staplers?", ("rooms?",)).matches,
    "time": Time("11:00", "12:00").matches,
    "claim": Claim("stapler").matches,
}
WORDS = (
    *UNITS,
    "a has b, no got, ",
    "a has b, ",
    "a and b, c is missing but not d, ",
    "chocolate 1 ",
    "he is, ",
    "a: b",
    "asked ",
    "1 or ",
    "?",
    "a. ",
    "3pm ",
)


SLOW = {"claim", "clauses", "gathered clauses", "number", "numerals", "polarity", "time", "times_in"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in FUNCTIONS]
)
def test_functions_that_read_texts_take_linear_time(name: str) -> None:
    texts = [
        RepeatedText(unit, prefix, suffix)
        for prefix in ("", "a has b, 1")
        for unit in WORDS
        for suffix in ("", "x 2")
    ]
    assert find_slow(FUNCTIONS[name], texts, [3_000], 0.25) is None  # linear functions take at most 0.05


@pytest.mark.slow
def test_regexes_of_the_papers_suite_take_linear_time() -> None:
    tasks = load_suite("paper").tasks.values()  # in that of `plus`, the linter would find others
    found = {pattern for task in tasks for pattern in searched_regexes(task)}
    assert len(found) > 50
    assert not {pattern for pattern in found if slow_text(pattern) is not None}


@pytest.mark.parametrize(
    "pattern",
    [
        *("(a|a)*b", "x.*y"),
        *(
            pytest.param(pattern, marks=pytest.mark.slow)
            for pattern in ("(a+)+b", r"a\s*\s*b", r"\w+n't", r"1[^.]*\bnot\b[^.]*y", "no (?!.*not)")
        ),
    ],
)
def test_a_slow_regex_is_found(pattern: str) -> None:
    assert slow_text(pattern) is not None


@pytest.mark.parametrize(
    "pattern",
    [
        *("(?:a?){30}a{30}", r"\w{0,20}" * 8 + "!"),
        *(
            pytest.param(pattern, marks=pytest.mark.slow)
            for pattern in (
                *("(?:a|aa){40}b", r"(?:\w{1,20} ?){1,12}!", "(?:(?=a)a|(?!b)a){25}b", "a?" * 30 + "a{30}"),
                "(?:(?:(?:x{0,99}){0,99}){0,99}){0,99}y",
            )
        ),
    ],
)
def test_slow_regex_with_bounded_repeats_is_found(pattern: str) -> None:
    assert slow_text(pattern) is not None


@pytest.mark.parametrize(
    "pattern",
    [
        *(r"\bserver room\b", r"[.!?]\s*$", "^(person|people|someone)?$", "knock.{0,20}door", "colou?rs?"),
        *(
            r"(?:\d{1,2}:)?\d{1,2} (?:am|pm)",
            "(?:mug|cup)s?(?:,? (?:and )?(?:mug|cup)s?)*",
            r"room \d{3}-\d{2}",
        ),
    ],
)
def test_ordinary_regex_is_not_called_slow(pattern: str) -> None:
    assert slow_text(pattern) is None
