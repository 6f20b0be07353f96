"""What each clause of a prompt asks for: the checks that cover it, or why none does."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from roboeval.suites.load import Task

FEW = 4  # words; what is shorter belongs to the clause before or after it, if there is one in its sentence
_SENTENCE = re.compile(r"(?:[!?]|(?<!\w\.\w)\.)[\"”)]*\s+")  # no end: "e.g. a cup", "5 p.m. sharp"
_JOINT = re.compile(r"[,;:]+[\"”]?\s+|\s+(?=(?:and|but)\s)")
_WORD = re.compile(r"\w+")
_SKIP = re.compile(r"(?<!\\)\.\*\??|\[\^[^\]]+\]\*\??")  # the part of a regex that finds any words

Span = tuple[int, int]


@dataclass(frozen=True)
class Clause:
    """A clause of a prompt.

    Args:
        prompt: the number of the prompt, counted from 0.
        text: the clause.
        checks: the checks that cover it.
        because: why no check does, if the task says so.
    """

    prompt: int
    text: str
    checks: tuple[str, ...]
    because: tuple[str, ...]

    @property
    def is_covered(self) -> bool:
        """Whether a check covers it, or it is said why none does."""
        return bool(self.checks or self.because)


def clauses_of(task: Task) -> Iterator[Clause]:
    """The clauses of all prompts, in their order.

    A check covers a clause that shares a word with a fact that it is said to cover, or with the words on
    which a requirement of it rests. What stands for `.*` in a fact's regex is no word of the fact.
    """
    for number, prompt in enumerate(task.prompts):
        text = " ".join(prompt.split())
        covering = [*_covering(task, number, text)]
        for start, end in _divided(text):
            found = [what for (first, last), what in covering if first < end and last > start]
            checks = dict.fromkeys(name for what in found if isinstance(what, tuple) for name in what)
            reasons = dict.fromkeys(what for what in found if isinstance(what, str))
            yield Clause(number, text[start:end].strip(), tuple(checks), tuple(reasons))


def _covering(task: Task, number: int, text: str) -> Iterator[tuple[Span, tuple[str, ...] | str]]:
    """Parts of a prompt, each with the checks that cover it, or why none does."""
    by_fact = dict(task.covered_by)
    for fact in task.facts:
        for words in fact.words if fact.fact in by_fact else ():
            yield from ((span, by_fact[fact.fact]) for span in _found(words, text))
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


def _found(words: str, text: str) -> Iterator[Span]:
    """Where a regex finds words, without those that it skips."""
    marked = _SKIP.sub(lambda skip: f"(?P<skip{skip.start()}>{skip[0]})", words)
    for match in re.finditer(marked, text, re.IGNORECASE):
        skipped = (match.span(name) for name in match.re.groupindex if name.startswith("skip"))
        edges = [match.start(), *(edge for span in skipped if span[0] >= 0 for edge in span), match.end()]
        yield from zip(edges[::2], edges[1::2], strict=True)


def _divided(text: str) -> Iterator[Span]:
    """Where the clauses of a text begin and end."""
    first = 0
    for last in [*(match.end() for match in _SENTENCE.finditer(text)), len(text)]:
        spans: list[Span] = []
        start = first
        for end in [*(match.end() for match in _JOINT.finditer(text, first, last)), last]:
            is_short = len(_WORD.findall(text, start, end)) < FEW
            if is_short and spans:
                spans[-1] = (spans[-1][0], end)
            elif is_short and end < last:
                continue  # it belongs to what follows
            else:
                spans.append((start, end))
            start = end
        yield from spans
        first = last
