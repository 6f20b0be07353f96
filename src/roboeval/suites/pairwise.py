"""Pairwise testing: a small set of combinations that covers every pair of values."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from itertools import combinations
from random import Random
from typing import TypeAlias

LevelRow: TypeAlias = dict[str, int]  # for each factor the position of its value
Pair: TypeAlias = tuple[int, int]  # the numbers of two values, the smaller one first

_TRIES = 12  # candidates for each row


def numbered(sizes: Mapping[str, int]) -> dict[str, range]:
    """A number for each value of each factor, of all factors by name."""
    numbers: dict[str, range] = {}
    start = 0
    for factor in sorted(sizes):
        numbers[factor] = range(start, start + sizes[factor])
        start += sizes[factor]
    return numbers


def spread(sizes: Mapping[str, int], count: int, random: Random) -> list[LevelRow]:
    """A covering array, filled up to `count` rows with random ones."""
    rows = covering(sizes, random)
    rows += [{name: random.randrange(size) for name, size in sizes.items()} for _ in range(count - len(rows))]
    return rows


def covering(sizes: Mapping[str, int], random: Random) -> list[LevelRow]:
    """Rows in which every pair of values meets; greedy, so that they are few but not the fewest."""
    if len(sizes) == 1:
        return [{factor: value} for factor, size in sizes.items() for value in range(size)]
    numbers = numbered(sizes)
    owner = {number: factor for factor, those in numbers.items() for number in those}
    left = {(a, b) for one, other in combinations(numbers.values(), 2) for a in one for b in other}
    rows: list[LevelRow] = []
    while left:
        seeds = random.sample(sorted(left), min(_TRIES, len(left)))
        partners = partners_of(left)
        candidates = [_row(numbers, {owner[a]: a, owner[b]: b}, partners, random) for a, b in seeds]
        best = max(candidates, key=lambda row: len(met(row) & left))
        left -= met(best)
        rows.append({factor: best[factor] - numbers[factor].start for factor in sizes})
    return rows


def met(row: Mapping[str, int]) -> set[Pair]:
    """The pairs of numbers that meet in a row of them."""
    return set(combinations(sorted(row.values()), 2))


def partners_of(pairs: Iterable[Pair]) -> Mapping[int, int]:
    """For each number those that it makes a pair with, as the bits of an integer."""
    partners: dict[int, int] = defaultdict(int)
    for a, b in pairs:
        partners[a] |= 1 << b
        partners[b] |= 1 << a
    return partners


def _row(
    numbers: Mapping[str, range], seed: LevelRow, partners: Mapping[int, int], random: Random
) -> LevelRow:
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
