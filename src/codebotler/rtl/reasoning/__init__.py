"""Reasoning about formulas: can they hold together, does one follow from others, do two mean the same?

Each function about formulas answers one question, and raises `Undecided` if that would take too long. A
`Reasoner` answers several, also for the rooms of one world; `satisfiability.py` is the search behind all.
"""

from __future__ import annotations

from codebotler.core.trace import Trace
from codebotler.rtl.formulas import Formula, Not
from codebotler.rtl.reasoning.automaton import Undecided
from codebotler.rtl.reasoning.regex_samples import samples
from codebotler.rtl.reasoning.satisfiability import Reasoner

__all__ = [
    "Reasoner",
    "Undecided",
    "are_equivalent",
    "conflict",
    "distinguishing_trace",
    "is_implied",
    "is_satisfiable",
    "samples",
    "satisfying_trace",
]


def is_satisfiable(*formulas: Formula) -> bool:
    """Whether some trace satisfies all formulas."""
    return Reasoner(formulas).trace(formulas) is not None


def satisfying_trace(*formulas: Formula) -> Trace | None:
    """A shortest trace that satisfies all formulas, or None if they contradict each other."""
    return Reasoner(formulas).trace(formulas, shortest=True)


def conflict(*formulas: Formula) -> list[Formula] | None:
    """Formulas that contradict each other, none of which can be left out, or None if all can hold."""
    return Reasoner(formulas).conflict(formulas)


def is_implied(formula: Formula, *premises: Formula) -> bool:
    """Whether a formula holds on every trace on which the premises hold.

    Args:
        formula: the conclusion.
        premises: the formulas it may follow from; without any, it must hold on every trace.
    """
    return Reasoner([formula, *premises]).trace([*premises, Not(formula)]) is None


def are_equivalent(one: Formula, other: Formula) -> bool:
    """Whether two formulas hold on the same traces."""
    return is_implied(one, other) and is_implied(other, one)


def distinguishing_trace(one: Formula, other: Formula) -> Trace | None:
    """A shortest trace on which only one of two formulas holds, or None if they are equivalent."""
    reasoner = Reasoner([one, other])
    found = (reasoner.trace([a, Not(b)], shortest=True) for a, b in ((one, other), (other, one)))
    return min((trace for trace in found if trace is not None), key=len, default=None)
