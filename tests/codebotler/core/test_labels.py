"""Labels of a world: slow or invalid regexes are refused, and accepted ones match quickly."""

import re
import time
from random import Random

import pytest

from codebotler.core.text.labels import SlowRegexError, check_label, expect_quick


@pytest.mark.parametrize(
    "label",
    [
        "kitchen",
        ".*mug.*",
        ".*",
        "kitchen|galley",
        "lab [12]",
        r"printer room \d+",
        "bob('s)? office",
        "^(?=.*tea)(?=.*hot)",
    ],
)
def test_fast_label_is_accepted(label: str) -> None:
    assert check_label(label) == label


@pytest.mark.parametrize(
    ("label", "why"),
    [
        ("(a+)+$", "a repetition"),
        ("(a|aa)+$", "a repetition"),
        ("(?:a|aa){40}b", "a repetition"),
        ("((a{100}){100}){100}", "a repetition"),
        ("(a?){30}b", "a repetition"),
        ("a*a*b", "two repetitions"),
        ("x.*y.*z", "two repetitions"),
        (r"\w*\w{0,30}\w{0,30}!", "too many ways"),
        ("(a|a)(a|a)(a|a)(a|a)(a|a)(a|a)a*c", "too many ways"),
        ("(?=.*a.*b)", "two repetitions"),
        ("a?" * 30 + "b", "too many ways"),
        ("[a-z]{0,50}" * 3 + "!", "too many ways"),
        ("(a|b|(?:c|d)?)" * 10 + "!", "too many ways"),
        (r"(\w)\1", "refers back to a group"),
    ],
)
def test_label_that_may_be_slow_is_refused(label: str, why: str) -> None:
    with pytest.raises(ValueError, match=f"too long: .*{why}"):
        check_label(label)


@pytest.mark.parametrize("label", ["(", "a{2}{3}", "(?<=a+)b", "*"])
def test_invalid_regex_is_refused(label: str) -> None:
    with pytest.raises(ValueError, match="not a valid regular expression"):
        check_label(label)


def draw_regex(random: Random, depth: int = 0) -> str:
    """Return a random regex of letters, choices, groups and repeats."""
    parts = []
    for _ in range(random.randint(1, 4)):
        kind = random.randrange(6 if depth < 3 else 3)
        part = random.choice("ab.") if kind < 3 else f"({draw_regex(random, depth + 1)})"
        if kind == 5:
            part = f"(?:{draw_regex(random, depth + 1)}|{draw_regex(random, depth + 1)})"
        parts.append(part + random.choice(["", "", "?", "*", "+", "{0,9}", "{0,200}"]))
    return "".join(parts)


@pytest.mark.slow
def test_accepted_random_labels_match_quickly() -> None:
    random, accepted = Random(1), 0
    for _ in range(3_000):
        label = draw_regex(random)
        try:
            expect_quick(label)
        except SlowRegexError:
            continue
        accepted += 1
        start = time.thread_time()
        for text in ("a" * 200 + "!", "ab" * 100 + "!", "b" * 200 + "c"):
            re.search(label + "[!]$", text, re.IGNORECASE | re.DOTALL)
        assert time.thread_time() - start < 1, label  # exponential ones take hours
    assert accepted > 300
