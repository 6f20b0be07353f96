"""Splits prompts into clauses, and finds the clauses that no check covers."""

from __future__ import annotations

import re
from collections.abc import Iterator

from roboeval.suites.load import Task

MIN_CLAUSE_WORDS = 4  # shorter clauses are merged with a neighbour in the same sentence
_SENTENCE = re.compile(r"(?:[!?]|(?<!\w\.\w)\.)[\"”)]*\s+")  # does not split "e.g. a cup" or "5 p.m. sharp"
_JOINT = re.compile(r"[,;:]+[\"”]?\s+|\s+(?=(?:and|but)\s)")
_WORD = re.compile(r"\w+")
_SKIP = re.compile(r"(?<!\\)\.\*\??|\[\^[^\]]+\]\*\??")  # parts of a regex that match any words

Span = tuple[int, int]


def uncovered_clauses(task: Task) -> Iterator[tuple[int, str]]:
    """Yield each clause (part of a sentence) in a task's prompts that no check covers: (prompt index, text).

    A requirement covers each clause from which it quotes a word. A fact in `covered_by` covers each clause
    in which its regex matches a word. Parts such as `.*`, which match any word, do not count.
    """
    for number, prompt in enumerate(task.prompts):
        text = " ".join(prompt.split())
        covered = [*_covered(task, number, text)]
        for start, end in _split_clauses(text):
            if not any(first < end and last > start for first, last in covered):
                yield number, text[start:end].strip()


def _covered(task: Task, number: int, text: str) -> Iterator[Span]:
    """Yield the parts of a prompt that facts or requirements cover."""
    facts = {fact for fact, _ in task.covered_by}
    for fact in task.facts:
        for words in fact.words if fact.fact in facts else ():
            yield from _find(words, text)
    required = {requirement for scenario in task.scenarios for requirement in scenario.require}
    for quoted in {words for one in required for asked, words in one.words if asked == number}:
        words = " ".join(quoted.split())
        start = text.lower().find(words.lower())
        yield start, start + len(words)


def _find(words: str, text: str) -> Iterator[Span]:
    """Yield the spans that a regex matches, without the parts that match any words, such as `.*`."""
    marked = _SKIP.sub(lambda skip: f"(?P<skip{skip.start()}>{skip[0]})", words)
    for match in re.finditer(marked, text, re.IGNORECASE):
        skipped = (match.span(name) for name in match.re.groupindex if name.startswith("skip"))
        edges = [match.start(), *(edge for span in skipped if span[0] >= 0 for edge in span), match.end()]
        yield from zip(edges[::2], edges[1::2], strict=True)


def _split_clauses(text: str) -> Iterator[Span]:
    first = 0
    for last in [*(match.end() for match in _SENTENCE.finditer(text)), len(text)]:
        spans: list[Span] = []
        start = first
        for end in [*(match.end() for match in _JOINT.finditer(text, first, last)), last]:
            is_short = len(_WORD.findall(text, start, end)) < MIN_CLAUSE_WORDS
            if is_short and spans:
                spans[-1] = (spans[-1][0], end)
            elif is_short and end < last:
                continue  # merge with the next clause
            else:
                spans.append((start, end))
            start = end
        yield from spans
        first = last
