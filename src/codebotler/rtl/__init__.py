"""The Robot Temporal Logic of the paper: parse a formula, test it on a trace, and say why it fails."""

from codebotler.rtl.explain import Explanation, explain
from codebotler.rtl.formula import (
    ActAtFirst,
    ActAtSome,
    And,
    AtLeast,
    Count,
    Cut,
    Element,
    Exists,
    Formula,
    Not,
    Or,
    Regex,
    Test,
    Text,
    Without,
    Words,
)
from codebotler.rtl.semantics import CannotJudge, holds
from codebotler.rtl.syntax import RtlSyntaxError, parse
from codebotler.rtl.text.claims import Claim, Number, Time

__all__ = [
    "ActAtFirst",
    "ActAtSome",
    "And",
    "AtLeast",
    "CannotJudge",
    "Claim",
    "Count",
    "Cut",
    "Element",
    "Exists",
    "Explanation",
    "Formula",
    "Not",
    "Number",
    "Or",
    "Regex",
    "RtlSyntaxError",
    "Test",
    "Text",
    "Time",
    "Without",
    "Words",
    "explain",
    "holds",
    "parse",
]
