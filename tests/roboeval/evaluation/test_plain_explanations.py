"""No explanation of a failure, label of a check or title of a world shows a regex."""

import re
from collections.abc import Iterator
from dataclasses import replace

import pytest

from codebotler.core.text.words import brief
from codebotler.core.trace import Trace
from codebotler.rtl import explain
from roboeval.linting.task_findings import judge_solutions
from roboeval.suites.load import Suite, Task, load_suite
from roboeval.suites.task import plain_check

REGEX = re.compile(r"\\[bBdDsSwW]|\.[*+]|\(\?|\||\[[^\]]*\]|\w[?*+]")
OPTIONS = re.compile(r"\[[ |]*\]")  # The options of a question, without their texts.
SUITES = ("paper", "plus")


def texts_in(trace: Trace) -> Iterator[str]:
    for event in trace:
        yield from (event.text, *(option.text for option in event.options), event.answer or "")


def without_spoken_texts(sentence: str, trace: Trace) -> str:
    for text in sorted(map(brief, texts_in(trace)), key=len, reverse=True):
        sentence = sentence.replace(text, "")
    return OPTIONS.sub("", sentence)


def explain_failures(task: Task, suite: Suite) -> Iterator[str]:
    for verdicts in judge_solutions(task, suite):
        for verdict in verdicts:
            for requirement in verdict.failed:
                why = explain(requirement.formula, verdict.outcome.trace)
                assert why is not None
                yield without_spoken_texts(why.sentence, verdict.outcome.trace)


@pytest.mark.slow  # Each suite has thousands of explanations.
@pytest.mark.parametrize(("name", "every"), [("paper", 1), ("plus", 5)])  # plus has 30 worlds of each task.
def test_explanations_of_wrong_solutions_show_no_regex(name: str, every: int) -> None:
    suite = load_suite(name)
    tasks = [replace(task, scenarios=task.scenarios[::every]) for task in suite.tasks.values()]
    found = {sentence for task in tasks for sentence in explain_failures(task, suite)}
    assert len(found) > 100
    assert [sentence for sentence in found if REGEX.search(sentence)] == []
    assert [sentence for sentence in found if "fits the requirement" in sentence] == []


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
