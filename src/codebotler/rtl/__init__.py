"""The Robot Temporal Logic of the paper: parse formulas, evaluate them on traces, explain failures."""

from codebotler.rtl.explanation import Explanation, explain
from codebotler.rtl.formulas import (
    ActAtFirst,
    ActAtSome,
    And,
    AtLeast,
    Count,
    EventPattern,
    Exists,
    Formula,
    Last,
    Not,
    Or,
    Regex,
    Scope,
    Test,
    TextPattern,
    Without,
    Words,
)
from codebotler.rtl.monitor import Monitor
from codebotler.rtl.semantics import Inconclusive, holds
from codebotler.rtl.source import RtlSyntaxError
from codebotler.rtl.syntax import parse
from codebotler.rtl.text.claims import Claim, Number, Time

__all__ = [
    "ActAtFirst",
    "ActAtSome",
    "And",
    "AtLeast",
    "Claim",
    "Count",
    "EventPattern",
    "Exists",
    "Explanation",
    "Formula",
    "Inconclusive",
    "Last",
    "Monitor",
    "Not",
    "Number",
    "Or",
    "Regex",
    "RtlSyntaxError",
    "Scope",
    "Test",
    "TextPattern",
    "Time",
    "Without",
    "Words",
    "explain",
    "holds",
    "parse",
]
