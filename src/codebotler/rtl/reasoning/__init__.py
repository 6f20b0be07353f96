"""Reasoning about formulas: can they hold together, does one follow from others, do two mean the same?

Each function answers one question; a `Reasoner` answers several, also for the rooms of one world. Start with
`questions.py`; `satisfiability.py` is the search behind all of them.
"""

from codebotler.rtl.reasoning.automaton import Undecided
from codebotler.rtl.reasoning.questions import (
    are_equivalent,
    conflict,
    distinguishing_trace,
    is_implied,
    is_satisfiable,
    satisfying_trace,
)
from codebotler.rtl.reasoning.satisfiability import Reasoner

__all__ = [
    "Reasoner",
    "Undecided",
    "are_equivalent",
    "conflict",
    "distinguishing_trace",
    "is_implied",
    "is_satisfiable",
    "satisfying_trace",
]
