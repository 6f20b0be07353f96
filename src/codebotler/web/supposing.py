"""What an imagined world is like, in a sentence for people who read no Python."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from codebotler.core.words import listed
from codebotler.simulator.sampled_robot import SOMEBODY, Fact, Reply, Whereabouts, brief

PLAIN = re.compile(r"[\w' -]+")
"""Names of rooms that need no quotes; others could be read as part of the sentence."""


def supposed(facts: Sequence[Fact]) -> str:
    """What is special about a world; empty where nothing was settled about it.

    Args:
        facts: that were settled, in that order.

    Returns:
        such as `If the robot finds “mug” in kitchen, but not in hall`.
    """
    clauses = list(dict.fromkeys(_clauses([fact.about for fact in facts])))
    if not clauses:
        return ""
    first, rest = clauses[0], [f"it {clause}" for clause in clauses[1:]]
    return f"If {listed([f'the robot {first}', *rest])}"


def _clauses(known: Sequence[Whereabouts | Reply]) -> Iterator[str]:
    """One for each that it looks for and for each answer, in the order in which they come first."""
    for one in known:
        if isinstance(one, Reply):
            yield f"is told {_quoted(one.answer)} when it asks {_quoted(one.question)} in {_room(one.room)}"
        else:
            same = [other for other in known if isinstance(other, Whereabouts) and other.name == one.name]
            yield _found(one.name, same)


def _found(name: str, known: Sequence[Whereabouts]) -> str:
    there = _rooms(known, is_there=True)
    lacking = _rooms(known, is_there=False)
    what, nothing = ("somebody", "nobody in") if name == SOMEBODY else (_quoted(name), "not in")
    if not there:
        return f"finds nobody in {lacking}" if name == SOMEBODY else f"does not find {what} in {lacking}"
    return f"finds {what} in {there}" + (f", but {nothing} {lacking}" if lacking else "")


def _rooms(known: Sequence[Whereabouts], *, is_there: bool) -> str:
    return listed(list(dict.fromkeys(_room(one.room) for one in known if one.is_there is is_there)))


def _room(name: str) -> str:
    return brief(name) if PLAIN.fullmatch(name) else _quoted(name)


def _quoted(text: str) -> str:
    return f"“{brief(text)}”"
