"""Random traces and formulas, small enough to meet each other."""

from dataclasses import replace

import pytest
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from codebotler.core.trace import Event, Option, Trace
from codebotler.rtl import (
    ActAtFirst,
    ActAtSome,
    And,
    AtLeast,
    Claim,
    Count,
    EventPattern,
    Exists,
    Formula,
    Not,
    Number,
    Or,
    Regex,
    Scope,
    Test,
    Text,
    Time,
    Without,
    Words,
)

NAMES = st.sampled_from(["a", "b", "ab", "a b", "No"])
PATTERNS = st.sampled_from([".*", "a", "b", "ab", "a|b", "^b", r"\bb\b", "no", "[", ""]).map(
    lambda pattern: pattern.replace("[", "[ab]$")
)
PLAIN = ("goto", "goto", "say", "check", "pick", "place")


def texts_from(patterns: SearchStrategy[str]) -> SearchStrategy[Text]:
    leaves: SearchStrategy[Text] = patterns.map(Regex) | patterns.map(Without)
    return st.recursive(
        leaves, lambda inner: st.lists(inner, min_size=1, max_size=3).map(tuple).map(Words), max_leaves=3
    )


def elements_from(patterns: SearchStrategy[str]) -> SearchStrategy[EventPattern]:
    texts = texts_from(patterns) | claims_from(patterns)
    plain = st.builds(EventPattern, st.sampled_from(PLAIN), texts)
    asked = st.builds(EventPattern, st.just("ask"), texts, texts)
    mentioned = st.builds(EventPattern, st.just("ask"), texts, st.none(), st.just(value=True))
    answered = st.builds(lambda text: EventPattern("ask", Regex(".*"), answer=text), texts)
    anywhere = plain | asked | mentioned | answered
    return anywhere | st.builds(lambda element, p: replace(element, place=p), anywhere, patterns)


def claims_from(patterns: SearchStrategy[str]) -> SearchStrategy[Text]:
    others = st.lists(patterns, max_size=2).map(tuple)
    return st.one_of(
        st.builds(Number, st.integers(0, 3), patterns, others, st.booleans()),
        st.builds(
            Time, st.sampled_from(["0:30", "11:00"]), st.sampled_from(["12:00", "13:30"]), st.booleans()
        ),
        st.builds(Claim, patterns, st.booleans()),
    )


def tests_from(patterns: SearchStrategy[str]) -> SearchStrategy[Test]:
    elements = elements_from(patterns)
    names = st.sampled_from(["BeforeFirst", "BeforeLast", "AfterFirst", "AfterLast"])
    scopes = st.lists(st.builds(Scope, names, elements), max_size=3).map(tuple)
    numbers = st.integers(0, 3)
    return st.one_of(
        st.builds(Exists, elements, scopes),
        st.builds(ActAtFirst, patterns, elements, scopes),
        st.builds(ActAtSome, patterns, elements, scopes),
        st.builds(Count, elements, numbers, scopes),
        st.builds(AtLeast, elements, numbers, scopes),
    )


def formulas_from(patterns: SearchStrategy[str]) -> SearchStrategy[Formula]:
    leaves: SearchStrategy[Formula] = tests_from(patterns)

    def larger(inner: SearchStrategy[Formula]) -> SearchStrategy[Formula]:
        parts = st.lists(inner, min_size=2, max_size=3).map(tuple)
        return parts.map(And) | parts.map(Or) | inner.map(Not)

    return st.recursive(leaves, larger, max_leaves=4)


def traces_from(options: SearchStrategy[Option]) -> SearchStrategy[Trace]:
    texts = NAMES | st.sampled_from(["2 a", "no b", "11:00", "3 a and 2 b"])
    plain = st.builds(Event, st.sampled_from(PLAIN), texts, place=NAMES)
    offered = st.lists(options, max_size=2).map(tuple)
    asked = st.builds(Event, st.just("ask"), texts, offered, st.none() | texts, place=NAMES)
    return st.lists(plain | asked, max_size=8).map(tuple)


@pytest.fixture(scope="session")
def elements() -> SearchStrategy[EventPattern]:
    return elements_from(PATTERNS)


@pytest.fixture(scope="session")
def formulas() -> SearchStrategy[Formula]:
    return formulas_from(PATTERNS)


@pytest.fixture(scope="session")
def single_tests() -> SearchStrategy[Test]:
    return tests_from(PATTERNS)


@pytest.fixture(scope="session")
def strange_formulas() -> SearchStrategy[Formula]:
    """Formulas whose regexes hold anything a string may hold."""
    return formulas_from(st.text(max_size=6).map(_escaped))


@pytest.fixture(scope="session")
def traces() -> SearchStrategy[Trace]:
    """Traces in which every option is text."""
    return traces_from(st.builds(Option, NAMES))


@pytest.fixture(scope="session")
def odd_traces() -> SearchStrategy[Trace]:
    """Traces in which some options are no text."""
    return traces_from(st.builds(Option, NAMES, st.booleans()))


def _escaped(text: str) -> str:
    # A bare backspace is refused on purpose; everything else is escaped only where a regex needs it.
    return "".join(f"\\{c}" if c in r"\.^$*+?{}[]()#" else c for c in text if c != "\b")
