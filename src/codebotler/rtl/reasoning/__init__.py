"""Decide whether formulas are satisfiable, equivalent or implied by other formulas.

Each function answers one question, and raises `Undecided` if that would take too long. A `Reasoner` answers
several questions, optionally for the rooms of one world; `satisfiability.py` contains the search.
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
    "conflict",
    "distinguishing_trace",
    "is_implied",
    "is_satisfiable",
    "samples",
    "satisfying_trace",
]


def is_satisfiable(*formulas: Formula) -> bool:
    """Whether some trace satisfies all formulas. Raise Undecided if the search would take too long."""
    return Reasoner(formulas).trace(formulas) is not None


def satisfying_trace(*formulas: Formula) -> Trace | None:
    """Return a shortest trace that satisfies all formulas, or None if they contradict each other."""
    return Reasoner(formulas).trace(formulas, shortest=True)


def conflict(*formulas: Formula) -> list[Formula] | None:
    """Return a minimal subset of formulas that contradict each other, or None if all can hold together."""
    return Reasoner(formulas).conflict(formulas)


def is_implied(formula: Formula, *premises: Formula) -> bool:
    """Whether a formula holds on every trace on which all premises hold."""
    return Reasoner([formula, *premises]).trace([*premises, Not(formula)]) is None


def distinguishing_trace(one: Formula, other: Formula) -> Trace | None:
    """Return a shortest trace on which only one of two formulas holds, or None if they are equivalent."""
    reasoner = Reasoner([one, other])
    found = (reasoner.trace([a, Not(b)], shortest=True) for a, b in ((one, other), (other, one)))
    return min((trace for trace in found if trace is not None), key=len, default=None)
