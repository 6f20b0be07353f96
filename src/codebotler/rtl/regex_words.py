"""List the plain texts that a regex matches, for readers who do not know regexes."""

from __future__ import annotations

from functools import lru_cache
from itertools import product
from typing import Any

from codebotler.core.text.words import brief, elide_list, listed
from codebotler.rtl.pattern import Tree, parse_tree

MATCH_ALL_PATTERNS = frozenset({"", ".*", ".+", "^.*$"})
UNCLEAR = "(…)"
_MAX_TEXTS = 40  # for each regex
_MIN_RANGE = 3  # longer sequences of numbers are shown as a range


@lru_cache(maxsize=4096)
def choices(pattern: str) -> tuple[str, ...] | None:
    """Return the texts that a regex finds, such as `bread` and `toast`, in their shortest form.

    Consecutive numbers are combined: `7[3-9]` gives `73 to 79`. Return None if there are too many texts, or
    if they cannot be determined.
    """
    try:
        found = [" ".join(text.split()) for text in _texts(parse_tree(pattern))]
    except _UnclearError:
        return None
    distinct = tuple(dict.fromkeys(found))
    if not all(text.strip("…, ") for text in distinct):
        return None
    if len(distinct) > _MIN_RANGE and all(text.isdecimal() and text.isascii() for text in distinct):
        numbers = sorted(map(int, distinct))
        if numbers[-1] - numbers[0] == len(numbers) - 1:
            return (f"{numbers[0]} to {numbers[-1]}",)
    return distinct


def one_of(texts: tuple[str, ...]) -> str:
    """Join alternatives: `"bread" or "toast"`. Show up to five texts, and count the rest."""
    return listed(elide_list([f'"{brief(text)}"' for text in texts]), "or")


def first_choice(pattern: str) -> str:
    """Return the first text that a regex finds, `anything` for `.*`, or `(…)` if it cannot be determined."""
    first = "anything" if pattern in MATCH_ALL_PATTERNS else (choices(pattern) or (UNCLEAR,))[0]
    return pattern if first == pattern.strip() or not pattern else first


class _UnclearError(Exception):
    """Raised if the texts of a regex cannot be determined."""


def _texts(tree: Tree) -> list[str]:
    texts = [""]
    for op, arguments in tree:
        each = _node_texts(str(op), arguments)
        texts = [text + part for text, part in product(texts, each)]
        if len(texts) > _MAX_TEXTS:
            raise _UnclearError
    return texts


def _node_texts(op: str, arguments: Any) -> list[str]:  # noqa: ANN401 - private classes of `re`
    if op == "LITERAL":
        return [chr(arguments)]
    if op == "IN":
        return _set_texts(arguments)
    if op in {"BRANCH", "SUBPATTERN"}:
        trees = arguments[1] if op == "BRANCH" else arguments[-1:]
        return [text for tree in trees for text in _texts(tree)]
    if op.endswith("REPEAT"):
        return _repeat_texts(*arguments)
    if op == "ASSERT_NOT":
        _texts(arguments[-1])  # so that a regex for cheese that is not grilled gives `cheese`
    elif op not in {"AT", "ANY"}:
        raise _UnclearError
    return ["…" if op == "ANY" else ""]


def _repeat_texts(least: int, most: int, tree: Tree) -> list[str]:
    if least == 0 and most == 1:
        return [""]
    if str(tree[0][0]) == "ANY" or _is_category(tree, "CATEGORY_WORD"):
        return ["…"]
    if _is_category(tree, "CATEGORY_NOT_WORD", "CATEGORY_SPACE"):
        return [" "]
    if least == 1:
        return _texts(tree)
    raise _UnclearError


def _is_category(tree: Tree, *names: str) -> bool:
    op, arguments = tree[0]
    members = [str(value) for _, value in arguments] if str(op) == "IN" else []
    return len(tree) == len(members) == 1 and members[0] in names


def _set_texts(members: Any) -> list[str]:  # noqa: ANN401 - private classes of `re`
    """Return the characters of a set, but only the first if it contains punctuation, which rarely matters."""
    characters: list[str] = []
    for op, value in members:
        if str(op) not in {"LITERAL", "RANGE"}:
            raise _UnclearError
        start, end = value if str(op) == "RANGE" else (value, value)
        characters += map(chr, range(start, min(end, start + _MAX_TEXTS) + 1))
    characters = [*dict.fromkeys(character.lower() for character in characters)]
    return characters if all(map(str.isalnum, characters)) else characters[:1]
