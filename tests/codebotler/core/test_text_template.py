"""Templates: the texts that they match, the templates that they cover, and how they are written."""

import random

import pytest

from codebotler.core.text.text_template import TextTemplate

ANY = TextTemplate(("", ""))


@pytest.mark.parametrize(
    ("template", "text", "is_match"),
    [
        ("hello", "hello", True),
        ("hello", " Hello\n", True),
        ("hello", "hello!", False),
        ("Caf\u00e9", "cafe\u0301", True),
        ("There are {} staplers", "there are 3  staplers", True),
        ("There are {} staplers", "There are  staplers", True),
        ("There are {} staplers", "There are staplers", True),
        ("There are {} staplers", "There are", False),
        ("There are {} staplers", "There are 3 staplers.", False),
        ("There are {} staplers", "there arestaplers", False),
        ("Rooms: {}", "Rooms:", True),
        ("{} is here", "is here", True),
        ("a{}a", "a", False),
        ("a{}a", "aa", True),
        ("{}ab{}b", "xab", False),
        ("{}ab{}b", "xababb", True),
        ("{}", "", True),
        ("{{}}{}", "{}x", True),
        ("", "", True),
        ("", "x", False),
    ],
)
def test_texts_match_piece_by_piece(template: str, text: str, *, is_match: bool) -> None:
    assert TextTemplate.parse(template).matches(text) is is_match


@pytest.mark.parametrize(
    ("wide", "narrow", "is_covered"),
    [
        ("{}", "a{}b", True),
        ("a{}", "A{}b", True),
        ("a{}", "a", True),
        ("a{}b", "a{}", False),
        ("a", "a{}", False),
        ("a {} b", "a b", True),
        ("{}c{}", "a{}b", False),
        ("a", "a", True),
    ],
)
def test_a_template_covers_another(wide: str, narrow: str, *, is_covered: bool) -> None:
    assert TextTemplate.parse(wide).covers(TextTemplate.parse(narrow)) is is_covered


def _random_text(rng: random.Random, letters: str, longest: int) -> str:
    return "".join(rng.choices(letters, k=rng.randint(0, longest)))


def test_covering_template_matches_every_text_of_the_covered_one() -> None:
    rng = random.Random(1)
    covered = 0
    for _ in range(400):
        parts = [tuple(_random_text(rng, "aB ", 2) for _ in range(rng.randint(1, 4))) for _ in range(2)]
        wide, narrow = map(TextTemplate, parts)
        text = parts[1][0] + "".join(_random_text(rng, "ab ", 2) + part for part in parts[1][1:])
        assert narrow.matches(text)
        assert TextTemplate.parse(str(narrow)) == narrow
        if wide.covers(narrow):
            covered += 1
            assert wide.matches(text)
    assert covered > 50


def test_adjacent_holes_merge_and_long_templates_match_any_text() -> None:
    assert TextTemplate(("a", "", "", "b")) == TextTemplate(("a", "b"))
    assert TextTemplate(("", "", "")) == ANY
    assert TextTemplate(("x",) * 21) == ANY
    assert TextTemplate(("x" * 2_001,)) == ANY
    assert not TextTemplate(("x" * 2_000,)).is_any


@pytest.mark.parametrize("wrong", ["{", "}", "{name}", "{!r}", "{:3}", "{0}"])
def test_a_single_brace_is_an_error(wrong: str) -> None:
    with pytest.raises(ValueError, match=r"\S"):
        TextTemplate.parse(wrong)


def test_a_template_without_parts_is_an_error() -> None:
    with pytest.raises(ValueError, match="part"):
        TextTemplate(())


def test_text_with_the_hole_character_matches_any_text() -> None:
    assert TextTemplate(("\ud800",)).is_any, "the hole character would hide what the text allows"
    assert not TextTemplate(("\udfff",)).matches("kitchen")


def test_beyond_returns_the_templates_that_none_covers() -> None:
    texts = [*map(TextTemplate.parse, ("mug", "Mug", "cup", "{} cup", "a {}", "a cup", "", "{}"))]
    for number in range(1 << 6):
        allowed = [one for bit, one in enumerate(texts[:6]) if number >> bit & 1]
        uncovered = [one for one in texts if not any(each.covers(one) for each in allowed)]
        assert TextTemplate.excess(texts, allowed) == uncovered
