"""All mutation operators: the ways in which models get robot programs wrong."""

from __future__ import annotations

from roboeval.mutation import counting, drives, flow, looks, messages, questions, things
from roboeval.mutation.operator import Operator

OPERATORS: tuple[Operator, ...] = (
    *drives.OPERATORS,
    *looks.OPERATORS,
    *questions.OPERATORS,
    *messages.OPERATORS,
    *things.OPERATORS,
    *counting.OPERATORS,
    *flow.OPERATORS,
)
"""By what they are about; the names are unique."""
