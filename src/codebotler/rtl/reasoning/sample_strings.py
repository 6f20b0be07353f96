"""Generate strings that match some regexes of formulas but not others.

Samples of the regexes are combined and tried, so a combination without a result may still be possible.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import chain, combinations, islice, permutations, product

from codebotler.rtl.formulas import Regex, TextPattern, Without, Words
from codebotler.rtl.reasoning.regex_samples import counter_samples, samples
from codebotler.rtl.text.claims import Claim, Number, Time

_MOST_SUBSETS = 400
_MOST_ALIKE = 2


@cache
def distinct_strings(texts: tuple[TextPattern, ...], *, outer: bool = False) -> tuple[str, ...]:
    """Return a short string for each combination of patterns that a candidate matches.

    `outer` allows outer spaces, which options may have and texts of events may not.
    """
    found: dict[tuple[bool, ...], str] = {}
    for candidate in _candidates(texts, outer=outer):
        found.setdefault(tuple([text.matches(candidate) for text in texts]), candidate)
    return tuple(found.values())


@cache
def can_match(text: TextPattern, *, outer: bool = False) -> bool:
    """Whether some candidate matches a pattern."""
    return any(map(text.matches, _candidates((text,), outer=outer)))


def patterns(text: TextPattern) -> Iterator[str]:
    """Yield the regexes in a text pattern."""
    match text:
        case Words(parts):
            yield from chain.from_iterable(map(patterns, parts))
        case Regex(pattern) | Without(pattern) | Claim(pattern):
            yield pattern
        case Number(_, thing, others):
            yield from (thing, *others)
        case Time():
            return


@cache
def _candidates(texts: tuple[TextPattern, ...], *, outer: bool) -> tuple[str, ...]:
    regexes = dict.fromkeys(chain.from_iterable(map(patterns, texts)))
    groups = [[*group] for one in regexes for group in (samples(one), counter_samples(one)) if group]
    words = [*dict.fromkeys([*chain.from_iterable(groups), *chain.from_iterable(map(_claims, texts))])]
    whole = [word for word in words if word]
    every = chain(
        ["", "x"],
        words,
        (f"x{word}x" for word in whole),
        (form for word in whole for form in (f"x {word}", f"{word} x")),
        _pairs(_distinguishable(whole, texts)),
        _subsets([group[0] for group in groups]),
        *(_join_parts(text.parts) for text in texts if isinstance(text, Words)),
        (form for word in words for form in (f" {word}", f"{word} ", f" {word} ")),
    )
    return tuple(dict.fromkeys(text for text in every if outer or text == text.strip()))


def _claims(text: TextPattern) -> Iterator[str]:
    """Yield strings with the claim of a pattern or a different one."""
    match text:
        case Words(parts):
            yield from chain.from_iterable(map(_claims, parts))
        case Number(number, thing, _):
            yield from (f"{given} {one}" for one in samples(thing) for given in (number, number + 1))
        case Time(start, end):
            yield from (start, end, "03:07", f"{start} or 03:07")
        case Claim(pattern):
            yield from (f"there is {no}{one}" for one in samples(pattern) for no in ("", "no "))
        case Regex() | Without():
            return


def _distinguishable(words: Iterable[str], texts: Sequence[TextPattern]) -> list[str]:
    """Keep the first two of all words that the patterns, their parts and regexes do not distinguish."""
    parts = chain.from_iterable(text.parts if isinstance(text, Words) else (text,) for text in texts)
    wanted = [*dict.fromkeys([*parts, *(Regex(pattern) for text in texts for pattern in patterns(text))])]
    alike: defaultdict[tuple[bool, ...], list[str]] = defaultdict(list)
    for word in words:
        alike[tuple([text.matches(word) for text in wanted])].append(word)
    return [word for several in alike.values() for word in several[:_MOST_ALIKE]]


def _pairs(words: Sequence[str]) -> Iterator[str]:
    return map(" ".join, product([*words, *(f"x{word}x" for word in words)], repeat=2))


def _subsets(words: Sequence[str]) -> Iterator[str]:
    """Yield all subsets of three or more words, the largest first, forwards and backwards."""
    subsets = chain.from_iterable(combinations(words, size) for size in range(len(words), 2, -1))
    return (" ".join(order) for subset in islice(subsets, _MOST_SUBSETS) for order in (subset, subset[::-1]))


def _join_parts(parts: Sequence[TextPattern]) -> Iterator[str]:
    groups = [
        [word for pattern in patterns(part) for word in samples(pattern)] or [""]
        for part in parts
        if not isinstance(part, Without)
    ]
    for order in islice(permutations(groups), 24):
        for choice in islice(product(*order), 64):
            yield from (joint.join(filter(None, choice)) for joint in (" ", "", "x"))
