"""Generate strings that match some of the regexes in formulas but not the others.

Only combinations of samples are tried, so a matching string may exist even if none is found.
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
    """Return short strings, one for each combination of the patterns `texts` that one string can match.

    `outer` allows spaces at the ends, which options may have but texts of events may not.
    """
    found: dict[tuple[bool, ...], str] = {}
    for candidate in _candidates(texts, outer=outer):
        found.setdefault(tuple([text.matches(candidate) for text in texts]), candidate)
    return tuple(found.values())


@cache
def can_match(text: TextPattern, *, outer: bool = False) -> bool:
    """Whether one of our generated strings matches a pattern. If False, another string may still match."""
    return any(map(text.matches, _candidates((text,), outer=outer)))


def patterns(text: TextPattern) -> Iterator[str]:
    """Yield the regexes in a pattern, such as `tea` and `milk` in `words("tea", "milk")`."""
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
    different = _distinguishable(whole, texts)
    every = chain(
        ["", "x"],
        words,
        (f"x{word}x" for word in whole),
        (form for word in whole for form in (f"x {word}", f"{word} x")),
        map(" ".join, product([*different, *(f"x{word}x" for word in different)], repeat=2)),
        _subsets([group[0] for group in groups]),
        *(_join_parts(text.parts) for text in texts if isinstance(text, Words)),
        (form for word in words for form in (f" {word}", f"{word} ", f" {word} ")),
    )
    return tuple(dict.fromkeys(text for text in every if outer or text == text.strip()))


def _claims(text: TextPattern) -> Iterator[str]:
    """Yield strings that make the claim of a pattern, or a different claim."""
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
    """Keep at most two of the words that the patterns, their parts and their regexes cannot tell apart."""
    parts = chain.from_iterable(text.parts if isinstance(text, Words) else (text,) for text in texts)
    wanted = [*dict.fromkeys([*parts, *(Regex(pattern) for text in texts for pattern in patterns(text))])]
    alike: defaultdict[tuple[bool, ...], list[str]] = defaultdict(list)
    for word in words:
        alike[tuple([text.matches(word) for text in wanted])].append(word)
    return [word for several in alike.values() for word in several[:_MOST_ALIKE]]


def _subsets(words: Sequence[str]) -> Iterator[str]:
    """Yield all subsets of three or more words, the largest first, in both directions."""
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
