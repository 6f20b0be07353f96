"""Generate strings that match a regex from its syntax tree."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from itertools import chain, zip_longest
from random import Random
from typing import Any

from codebotler.rtl.formulas import Regex
from codebotler.rtl.pattern import PATTERN_FLAGS, Tree, parse_tree

_MOST_SAMPLES = 4
_MOST_SPELLED = 16
_LONGEST = 10_000


def failing_regex(pattern: str) -> re.Pattern[str]:
    """Compile a variant of a regex that never matches, so that a search tries all possibilities."""
    tree = parse_tree(pattern)
    _loosen(tree)
    tree.append(parse_tree("(?!)")[0])
    compiled: re.Pattern[str] = import_module("re._compiler").compile(tree, PATTERN_FLAGS)
    return compiled


def _loosen(tree: Tree) -> None:
    for at, (op, arguments) in enumerate(tree):
        if str(op) in {"MAX_REPEAT", "MIN_REPEAT"} and arguments[2].getwidth()[0]:
            tree[at] = (op, (min(arguments[0], 1), *arguments[1:]))
        for inner in inner_trees(str(op), arguments) if str(op) != "ASSERT_NOT" else ():
            _loosen(inner)


def inner_trees(op: str, arguments: Any) -> list[Tree]:  # noqa: ANN401 - private classes of `re`
    """Return the parts directly inside a node of a parsed regex, such as `tea` and `milk` in `tea|milk`."""
    match op:
        case "BRANCH":
            return list(arguments[1])
        case "SUBPATTERN" | "ASSERT" | "ASSERT_NOT":
            return [arguments[-1]]
        case "ATOMIC_GROUP":
            return [arguments]
        case "MAX_REPEAT" | "MIN_REPEAT" | "POSSESSIVE_REPEAT":
            return [arguments[2]]
    return []


@cache
def samples(pattern: str) -> tuple[str, ...]:
    """Return up to four strings in which a regex is found, without outer spaces if possible."""
    words = _spell_in_all_ways(parse_tree(pattern))
    forms = [form.replace("{}", word) for form in ("{}", "x {}", "x {} x", "x{}x") for word in words]
    tries = (map(str.strip, forms), forms, _guesses(pattern))
    found = (dict.fromkeys(filter(Regex(pattern).matches, several)) for several in tries)
    return tuple(next(filter(None, found), {}))[:_MOST_SAMPLES]


def counter_samples(pattern: str) -> list[str]:
    """Return strings that a regex rules out by `(?!...)`, such as `grilled` for `(?!grilled)cheese`."""
    denied = (arguments[-1] for op, arguments in parse_tree(pattern) if str(op) == "ASSERT_NOT")
    words = (word.strip() for tree in denied for word in _spell_in_all_ways(tree)[:_MOST_SPELLED])
    return [*dict.fromkeys(filter(None, words))]


def _guesses(pattern: str) -> Iterator[str]:
    random, letters = Random(pattern), f"{pattern}x1 "  # noqa: S311 - no secret
    return ("".join(random.choices(letters, k=random.randint(0, 8))).strip() for _ in range(3_000))


def _spell_in_all_ways(tree: Tree) -> list[str]:
    """Spell out a tree in three ways: without gaps, with gaps, and with gaps and the lookaheads last."""
    behind = sorted(tree, key=lambda node: str(node[0]) == "ASSERT")
    ways = zip_longest(spell_out(tree), spell_out(tree, " "), spell_out(behind, " "))
    return [*dict.fromkeys(text for text in chain.from_iterable(ways) if text is not None)]


def spell_out(tree: Tree, gap: str = "") -> list[str]:
    """Return a few strings that a parsed regex matches. Parts that match any text, as `.*`, become `gap`."""
    texts = [""]
    for op, arguments in tree:
        parts = _spell_node(op, arguments, gap)
        texts = [*dict.fromkeys(text + part for part in parts for text in texts)][:_MOST_SPELLED]
    return texts


def _spell_node(op: object, arguments: Any, gap: str) -> list[str]:  # noqa: ANN401 - private classes of `re`
    inner = [spell_out(tree, gap) for tree in inner_trees(str(op), arguments)]
    match str(op):
        case "LITERAL":
            return [chr(arguments)]
        case "NOT_LITERAL" | "ANY" | "IN":
            return _characters(op, arguments, gap)
        case "BRANCH" | "SUBPATTERN" | "ATOMIC_GROUP":
            most = _MOST_SPELLED if len(inner) == 1 else _MOST_SAMPLES
            return [text for texts in inner for text in texts[:most]]
        case "ASSERT":
            return [text + gap for text in inner[0]]
        case "MAX_REPEAT" | "MIN_REPEAT" | "POSSESSIVE_REPEAT":
            least = arguments[0]
            repeated = [text * max(least, 1) for text in inner[0] if len(text) * least <= _LONGEST]
            none = [] if least else [""]
            return [*repeated, *none] if gap else [*none, *repeated]
    return [""]


def _characters(op: object, arguments: Any, gap: str) -> list[str]:  # noqa: ANN401 - private classes of `re`
    """Return some characters of a set, literal ones first, or only one if the set contains nearly all."""
    parser = import_module("re._parser")
    node = parser.SubPattern(parser.State(), [(op, arguments)])
    one = import_module("re._compiler").compile(node, PATTERN_FLAGS)
    members = arguments if str(op) == "IN" else []
    codes = [codes for kind, codes in members if str(kind) in {"LITERAL", "RANGE"}]
    ends = [chr(end) for each in codes for end in (each if isinstance(each, tuple) else (each,))]
    found = [char for char in dict.fromkeys([*gap, *ends, *"ab1 _-.'z"]) if one.match(char)]
    return found[: _MOST_SAMPLES if members else 1]
