"""Pairwise testing: a small set of combinations that covers every pair of values."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations, product
from random import Random
from typing import TypeAlias

Row: TypeAlias = dict[str, int]  # for each factor the position of its value
Pair: TypeAlias = tuple[tuple[str, int], tuple[str, int]]

_TRIES = 12  # candidates for each row


def pairs(sizes: Mapping[str, int]) -> set[Pair]:
    """All pairs of values of two factors."""
    return {
        ((one, i), (other, j))
        for one, other in combinations(sorted(sizes), 2)
        for i, j in product(range(sizes[one]), range(sizes[other]))
    }


def met(row: Row) -> set[Pair]:
    """The pairs that meet in a row."""
    return set(combinations(sorted(row.items()), 2))


def spread(sizes: Mapping[str, int], count: int, random: Random) -> list[Row]:
    """A covering array, filled up to `count` rows with random ones."""
    rows = covering(sizes, random)
    rows += [{name: random.randrange(size) for name, size in sizes.items()} for _ in range(count - len(rows))]
    return rows


def covering(sizes: Mapping[str, int], random: Random) -> list[Row]:
    """Rows in which every pair of values meets; greedy, so that they are few but not the fewest."""
    if len(sizes) == 1:
        return [{factor: value} for factor, size in sizes.items() for value in range(size)]
    left = pairs(sizes)
    rows: list[Row] = []
    while left:
        seeds = random.sample(sorted(left), min(_TRIES, len(left)))
        candidates = [_row(sizes, seed, left, random) for seed in seeds]
        rows.append(max(candidates, key=lambda row: len(met(row) & left)))
        left -= met(rows[-1])
    return rows


def _row(sizes: Mapping[str, int], seed: Pair, left: set[Pair], random: Random) -> Row:
    row = dict(seed)
    factors = [factor for factor in sorted(sizes) if factor not in row]
    random.shuffle(factors)
    for factor in factors:
        values = random.sample(range(sizes[factor]), sizes[factor])
        row[factor] = max(values, key=lambda value: _gained(row, (factor, value), left))
    return {factor: row[factor] for factor in sizes}


def _gained(row: Row, new: tuple[str, int], left: set[Pair]) -> int:
    return sum((min(new, old), max(new, old)) in left for old in row.items())
