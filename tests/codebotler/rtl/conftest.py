"""Random traces and formulas from so few words that they often match each other."""

from dataclasses import replace
from typing import get_args

import pytest
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from codebotler import rtl
from codebotler.core.text.unicode import compose
from codebotler.core.trace import Event, Option, Trace
from codebotler.rtl.formulas import ScopeName

NAMES = st.sampled_from(["a", "b", "ab", "a b", "No"])
PATTERNS = st.sampled_from([".*", "a", "b", "ab", "a|b", "^b", r"\bb\b", "no", "[", ""]).map(
    lambda pattern: pattern.replace("[", "[ab]$")
)
PLAIN = ("goto", "goto", "say", "check", "pick", "place")


def texts_from(patterns: SearchStrategy[str]) -> SearchStrategy[rtl.TextPattern]:
    leaves: SearchStrategy[rtl.TextPattern] = patterns.map(rtl.Regex) | patterns.map(rtl.Without)
    return st.recursive(
        leaves, lambda inner: st.lists(inner, min_size=1, max_size=3).map(tuple).map(rtl.Words), max_leaves=3
    )


def elements_from(patterns: SearchStrategy[str]) -> SearchStrategy[rtl.EventPattern]:
    texts = texts_from(patterns) | claims_from(patterns)
    plain = st.builds(rtl.EventPattern, st.sampled_from(PLAIN), texts)
    asked = st.builds(rtl.EventPattern, st.just("ask"), texts, texts)
    mentioned = st.builds(rtl.EventPattern, st.just("ask"), texts, st.none(), st.just(value=True))
    answered = st.builds(lambda text: rtl.EventPattern("ask", rtl.Regex(".*"), answer=text), texts)
    looks = st.builds(lambda text, found: rtl.EventPattern("check", text, found=found), texts, st.booleans())
    anything = plain | asked | mentioned | answered | looks

    @st.composite
    def element(draw: st.DrawFn) -> rtl.EventPattern:
        drawn = draw(anything)
        if drawn.kind == "ask" and draw(st.booleans()):
            drawn = replace(drawn, to=draw(texts))
        if draw(st.integers(0, 3)) == 0:
            drawn = replace(drawn, holding=draw(texts))
        return replace(drawn, place=draw(patterns)) if draw(st.booleans()) else drawn

    return element()


def claims_from(patterns: SearchStrategy[str]) -> SearchStrategy[rtl.TextPattern]:
    others = st.lists(patterns, max_size=2).map(tuple)
    return st.one_of(
        st.builds(rtl.Number, st.integers(0, 3), patterns, others, st.booleans()),
        st.builds(
            rtl.Time, st.sampled_from(["0:30", "11:00"]), st.sampled_from(["12:00", "13:30"]), st.booleans()
        ),
        st.builds(rtl.Claim, patterns, st.booleans()),
    )


def tests_from(patterns: SearchStrategy[str]) -> SearchStrategy[rtl.Test]:
    elements = elements_from(patterns)
    names = st.sampled_from(get_args(ScopeName))
    scopes = st.lists(st.builds(rtl.Scope, names, elements), max_size=3).map(tuple)
    numbers = st.integers(0, 3)
    return st.one_of(
        st.builds(rtl.Exists, elements, scopes),
        st.builds(rtl.Last, elements, scopes),
        st.builds(rtl.ActAtFirst, patterns, elements, scopes),
        st.builds(rtl.ActAtSome, patterns, elements, scopes),
        st.builds(rtl.Count, elements, numbers, scopes),
        st.builds(rtl.AtLeast, elements, numbers, scopes),
    )


def formulas_from(patterns: SearchStrategy[str]) -> SearchStrategy[rtl.Formula]:
    leaves: SearchStrategy[rtl.Formula] = tests_from(patterns)

    def larger(inner: SearchStrategy[rtl.Formula]) -> SearchStrategy[rtl.Formula]:
        parts = st.lists(inner, min_size=2, max_size=3).map(tuple)
        return parts.map(rtl.And) | parts.map(rtl.Or) | inner.map(rtl.Not)

    return st.recursive(leaves, larger, max_leaves=4)


def traces_from(options: SearchStrategy[Option]) -> SearchStrategy[Trace]:
    texts = NAMES | st.sampled_from(["2 a", "no b", "11:00", "3 a and 2 b"])
    held = st.just("") | NAMES
    plain = st.builds(Event, st.sampled_from(PLAIN), texts, place=NAMES, holding=held)
    looks = st.builds(Event, st.just("check"), texts, found=st.booleans(), place=NAMES, holding=held)
    offered = st.lists(options, max_size=2).map(tuple)
    answer = st.none() | texts
    asked = st.builds(Event, st.just("ask"), texts, offered, answer, place=NAMES, holding=held, to=held)
    return st.lists(plain | looks | asked, max_size=8).map(tuple)


@pytest.fixture(scope="session")
def elements() -> SearchStrategy[rtl.EventPattern]:
    return elements_from(PATTERNS)


@pytest.fixture(scope="session")
def formulas() -> SearchStrategy[rtl.Formula]:
    return formulas_from(PATTERNS)


@pytest.fixture(scope="session")
def single_tests() -> SearchStrategy[rtl.Test]:
    return tests_from(PATTERNS)


@pytest.fixture(scope="session")
def strange_formulas() -> SearchStrategy[rtl.Formula]:
    """Return formulas whose regexes hold any characters."""
    return formulas_from(st.text(max_size=6).map(compose).map(_escape))


@pytest.fixture(scope="session")
def traces() -> SearchStrategy[Trace]:
    """Return traces in which every option is text."""
    return traces_from(st.builds(Option, NAMES, st.just(value=True)))


@pytest.fixture(scope="session")
def mixed_traces() -> SearchStrategy[Trace]:
    """Return traces in which some options are not text."""
    return traces_from(st.builds(Option, NAMES, st.booleans()))


def _escape(text: str) -> str:
    # The parser refuses a bare backspace; only characters with a meaning in regexes need an escape.
    return "".join(f"\\{c}" if c in r"\.^$*+?{}[]()#" else c for c in text if c != "\b")
