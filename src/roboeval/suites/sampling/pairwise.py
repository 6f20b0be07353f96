"""Generates combinations for pairwise testing: a small set that covers every pair of values."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from itertools import combinations
from random import Random
from typing import TypeAlias

Combination: TypeAlias = dict[str, int]  # for each factor, the index of its value
Pair: TypeAlias = tuple[int, int]  # the numbers of two values, in ascending order

_TRIES = 12  # number of candidates tried for each combination


def number_values(sizes: Mapping[str, int]) -> dict[str, range]:
    """Number the values of all factors: if a has 2 values and b has 3, a gets 0 and 1, and b gets 2 to 4."""
    numbers: dict[str, range] = {}
    start = 0
    for factor in sorted(sizes):
        numbers[factor] = range(start, start + sizes[factor])
        start += sizes[factor]
    return numbers


def sample_combinations(sizes: Mapping[str, int], count: int, random: Random) -> list[Combination]:
    """Return combinations that cover all pairs of values, plus random ones up to `count` in all."""
    rows = cover_pairs(sizes, random)
    rows += [{name: random.randrange(size) for name, size in sizes.items()} for _ in range(count - len(rows))]
    return rows


def cover_pairs(sizes: Mapping[str, int], random: Random) -> list[Combination]:
    """Return a small set of combinations that covers all pairs of values of the factors in `sizes`."""
    if len(sizes) == 1:
        return [{factor: value} for factor, size in sizes.items() for value in range(size)]
    numbers = number_values(sizes)
    owner = {number: factor for factor, those in numbers.items() for number in those}
    left = {(a, b) for one, other in combinations(numbers.values(), 2) for a in one for b in other}
    rows: list[Combination] = []
    while left:
        seeds = random.sample(sorted(left), min(_TRIES, len(left)))
        partners = partners_of(left)
        candidates = [_complete(numbers, {owner[a]: a, owner[b]: b}, partners, random) for a, b in seeds]
        best = max(candidates, key=lambda row: len(pairs_in(row) & left))
        left -= pairs_in(best)
        rows.append({factor: best[factor] - numbers[factor].start for factor in sizes})
    return rows


def pairs_in(row: Mapping[str, int]) -> set[Pair]:
    """Return all pairs of a combination's value numbers: 0, 3, 7 give (0, 3), (0, 7) and (3, 7)."""
    return set(combinations(sorted(row.values()), 2))


def partners_of(pairs: Iterable[Pair]) -> Mapping[int, int]:
    """Map each number to the set of its partners in the pairs, as bits: partners 1 and 2 give 0b110."""
    partners: dict[int, int] = defaultdict(int)
    for a, b in pairs:
        partners[a] |= 1 << b
        partners[b] |= 1 << a
    return partners


def _complete(
    numbers: Mapping[str, range], seed: Combination, partners: Mapping[int, int], random: Random
) -> Combination:
    row = dict(seed)
    chosen = sum(1 << number for number in row.values())
    factors = [factor for factor in numbers if factor not in row]
    random.shuffle(factors)
    for factor in factors:
        values = random.sample(numbers[factor], len(numbers[factor]))
        best = max(values, key=lambda value: (partners[value] & chosen).bit_count())
        row[factor] = best
        chosen |= 1 << best
    return row
