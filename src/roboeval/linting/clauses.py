"""Splits prompts into clauses, and finds the checks that cover each clause or the reason why none does."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from roboeval.suites.load import Task

MIN_CLAUSE_WORDS = 4  # shorter clauses are merged with a neighbour in the same sentence
_SENTENCE = re.compile(r"(?:[!?]|(?<!\w\.\w)\.)[\"”)]*\s+")  # does not split "e.g. a cup" or "5 p.m. sharp"
_JOINT = re.compile(r"[,;:]+[\"”]?\s+|\s+(?=(?:and|but)\s)")
_WORD = re.compile(r"\w+")
_SKIP = re.compile(r"(?<!\\)\.\*\??|\[\^[^\]]+\]\*\??")  # parts of a regex that match any words

Span = tuple[int, int]


@dataclass(frozen=True)
class Clause:
    """A clause of a prompt, with the checks that cover it."""

    prompt: int  # the number of the prompt, from 0
    text: str
    checks: tuple[str, ...]  # the checks that cover the clause
    because: tuple[str, ...]  # reasons from the task file why no check covers the clause

    @property
    def is_covered(self) -> bool:
        """Whether a check covers the clause, or the task file gives a reason why none does."""
        return bool(self.checks or self.because)


def clauses_of(task: Task) -> Iterator[Clause]:
    """Yield the clauses of all prompts, in order.

    A check covers a clause if they share a word. They share it if a requirement with the check quotes the
    word, or if the task lists a fact for the check and the fact's regex matches the word other than by `.*`.
    """
    for number, prompt in enumerate(task.prompts):
        text = " ".join(prompt.split())
        covering = [*_covering(task, number, text)]
        for start, end in _split_clauses(text):
            found = [what for (first, last), what in covering if first < end and last > start]
            checks = dict.fromkeys(name for what in found if isinstance(what, tuple) for name in what)
            reasons = dict.fromkeys(what for what in found if isinstance(what, str))
            yield Clause(number, text[start:end].strip(), tuple(checks), tuple(reasons))


def _covering(task: Task, number: int, text: str) -> Iterator[tuple[Span, tuple[str, ...] | str]]:
    """Yield parts of a prompt, each with the checks that cover it or the reason why none does."""
    by_fact = dict(task.covered_by)
    for fact in task.facts:
        for words in fact.words if fact.fact in by_fact else ():
            yield from ((span, by_fact[fact.fact]) for span in _find(words, text))
    required = {requirement for scenario in task.scenarios for requirement in scenario.require}
    quotes = {
        (" ".join(words.split()), one.check)
        for one in required
        for asked, words in one.words
        if asked == number
    }
    for words, check in sorted(quotes):
        start = text.lower().find(words.lower())
        yield (start, start + len(words)), (check,)


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
