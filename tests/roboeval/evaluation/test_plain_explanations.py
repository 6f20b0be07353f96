"""No label of a check or title of a world shows a regex; see tests/suites for explanations of failures."""

import pytest

from plain_words import REGEX
from roboeval.suites.load import load_suite
from roboeval.suites.task import plain_check

SUITES = ("paper", "plus")


@pytest.mark.slow
@pytest.mark.parametrize("name", SUITES)
def test_titles_of_worlds_and_labels_of_checks_show_no_regex(name: str) -> None:
    worlds = [world for task in load_suite(name).tasks.values() for world in task.scenarios]
    labels = {plain_check(requirement.text) for world in worlds for requirement in world.require}
    assert [text for text in {*labels, *(world.world.about for world in worlds)} if REGEX.search(text)] == []


@pytest.mark.parametrize(
    ("text", "label"),
    [
        ('reports(r"40|forty|^4\\b")', 'reports("40")'),
        ('not says("please\\\\W+follow")', 'not says("please follow")'),
        ('greets("amy\'s lab", 2)', 'greets("amy\'s lab", 2)'),
        ("comes_back", "comes_back"),
    ],
)
def test_a_label_shows_words(text: str, label: str) -> None:
    assert plain_check(text) == label
