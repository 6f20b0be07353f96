"""What people read about a failure, of which no part may be a regex."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from codebotler.core.text.words import brief
from codebotler.core.trace import Trace
from codebotler.rtl import explain
from roboeval.evaluation.judging.failures import Verdict

REGEX = re.compile(r"\\[bBdDsSwW]|\.[*+]|\(\?|\||\[[^\]]*\]|\w[?*+]")
OPTIONS = re.compile(r"\[[ |]*\]")  # The options of a question, without their texts.


def texts_in(trace: Trace) -> Iterator[str]:
    for event in trace:
        yield from (event.text, *(option.text for option in event.options), event.answer or "")


def without_spoken_texts(sentence: str, trace: Trace) -> str:
    for text in sorted(map(brief, texts_in(trace)), key=len, reverse=True):
        sentence = sentence.replace(text, "")
    return OPTIONS.sub("", sentence)


def explain_failures(verdicts: Iterable[Verdict]) -> set[str]:
    """Explain why requirements are not met, without the texts that programs say."""
    found = set()
    for verdict in verdicts:
        for requirement in verdict.failed:
            why = explain(requirement.formula, verdict.outcome.trace)
            assert why is not None
            found.add(without_spoken_texts(why.sentence, verdict.outcome.trace))
    return found


def expect_plain_words(sentences: Iterable[str]) -> None:
    """Expect that no sentence shows a regex, or leaves out what a requirement is about."""
    assert [sentence for sentence in sentences if REGEX.search(sentence)] == []
    assert [sentence for sentence in sentences if "fits the requirement" in sentence] == []
