"""Review house rules: find an example that keeps each rule, one that breaks it, and likely mistakes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations

from codebotler.checking.house_rules.rooms import may_mean, unknown_rooms_in
from codebotler.core.skills.declaration import by_event
from codebotler.core.skills.kinds import GOTO, PICK, PLACE
from codebotler.core.skills.paper import SKILLS
from codebotler.core.trace import Option, Trace
from codebotler.core.world import World
from codebotler.rtl import And, EventPattern, Exists, Formula, Last, Not, Or, Regex, Scope, TextPattern
from codebotler.rtl.reasoning import Reasoner, Undecided
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.rtl.reasoning.sample_strings import distinct_strings
from codebotler.simulator.guard.house_rule import Rule, RuleViolationError, WhenJudged
from codebotler.simulator.guard.rule_guard import RuleGuard, name_of
from codebotler.simulator.worlds.matching import WORDS_FOR_PEOPLE, meant_by

NEVER_BROKEN = "nothing can break this rule; look for a misspelt name, or for a part that is always true"
ALWAYS_BROKEN = "everything that a robot can do breaks this rule"
IMPOSSIBLE = "no program can keep this rule"
UNDECIDED = 'this rule is too complex for examples, but still enforced; split it at "and" into several rules'
DETECTED = (
    "the result of a look or an answer can break this rule; "
    "results cannot be prevented, so the mission stops right afterwards"
)
OTHER_ANSWER = "something else"  # an answer that no rule names
ORDER: Sequence[WhenJudged] = ("always", "leaving", "finally")  # by how often each is judged
ANY_EVENT = Or(tuple(Exists(EventPattern(kind, Regex(".*"))) for kind in SKILLS.recordings))


@dataclass(frozen=True)
class Review:
    """A house rule with a trace that keeps the rule, one that breaks it, and warnings."""

    rule: Rule
    keeps: Trace | None  # a shortest trace that keeps the rule, if possible with an event it mentions
    breaks: Trace | None  # a shortest trace that breaks the rule
    warnings: tuple[str, ...]  # one sentence each


def review_rules(rules: Sequence[Rule], world: World | None = None) -> list[Review]:
    """Return examples and warnings for each rule. If a world is given, the examples use its rooms."""
    found = {rule.name: _review(rule, world) for rule in rules}
    for one, other in combinations(rules, 2):
        for rule, warning in _pair_warnings(one, other, world):
            review = found[rule.name]
            found[rule.name] = replace(review, warnings=(*review.warnings, warning))
    return list(found.values())


def _review(rule: Rule, world: World | None) -> Review:
    warnings = [*_unknown_names(rule, world)]
    try:
        breaks = _breaking_trace(rule, world)
        keeps = _keeping_trace(rule, world)
    except Undecided:
        return Review(rule, None, None, (*warnings, UNDECIDED))
    if breaks is None:
        warnings.append(NEVER_BROKEN)
    elif rule.when == "always" and any(
        _is_by_result(rule, one) for one in _breaking_traces(rule, breaks, world)
    ):
        warnings.append(DETECTED)
    if keeps is None:
        warnings.append(ALWAYS_BROKEN if rule.when == "always" else IMPOSSIBLE)
    return Review(rule, keeps, breaks, tuple(warnings))


def _breaking_trace(rule: Rule, world: World | None) -> Trace | None:
    """Return a shortest trace that breaks a rule."""
    traces = [_trace([Not(part)], [], world) for part in _conjuncts(rule.formula)]
    return min((trace for trace in traces if trace is not None), key=len, default=None)


def _breaking_traces(rule: Rule, shortest: Trace, world: World | None) -> Iterator[Trace]:
    """Yield a shortest trace that breaks a rule, then traces that end with a result the rule mentions."""
    yield shortest
    for element in dict.fromkeys(elements(rule.formula)):
        if element.found is not None or element.answer is not None:
            trace = _trace([Not(rule.formula), Last(element)], [], world)
            if trace is not None:
                yield trace


def _is_by_result(rule: Rule, breaks: Trace) -> bool:
    """Whether the result of the last step breaks the rule, rather than the step itself."""
    guard = RuleGuard([rule])
    try:
        for event in breaks[:-1]:
            guard.judge_result(event)
    except RuleViolationError:
        return False
    last = breaks[-1]
    if last.answer is not None:  # a question always has another option
        last = replace(last, options=(*last.options, Option(last.answer), Option(OTHER_ANSWER)))
    try:
        guard.judge(replace(last, found=None, answer=None))
    except RuleViolationError:
        return False
    return True


def _keeping_trace(rule: Rule, world: World | None) -> Trace | None:
    spoken_of = [*dict.fromkeys(elements(rule.formula))]
    if rule.when == "leaving":
        spoken_of.reverse()  # such formulas name what must be undone last
    less = [replace(one, place=None) for one in spoken_of] + [replace(one, holding=None) for one in spoken_of]
    kinds = [EventPattern(kind, Regex(".*")) for kind in dict.fromkeys(one.kind for one in spoken_of)]
    happenings: list[Formula] = [*map(Exists, dict.fromkeys([*spoken_of, *less, *kinds])), ANY_EVENT]
    for happens in happenings:
        trace = _trace([happens], [rule], world)
        if trace is not None:
            return trace
    return _trace([rule.formula], [], world) if rule.when != "always" else None


def _trace(wanted: Sequence[Formula], kept: Sequence[Rule], world: World | None) -> Trace | None:
    """Return a shortest trace on which formulas hold and rules are kept, or None if there is none.

    Of a rule for leaving a room, which is also judged at the end, only the end counts.
    """
    always = [part for rule in kept if rule.when == "always" for part in _conjuncts(rule.formula)]
    finally_ = [part for rule in kept if rule.when != "always" for part in _conjuncts(rule.formula)]
    spoken_of = [*wanted, *always, *finally_]
    moves = None if world is None else {room: room for room in _rooms(spoken_of, world)}
    start = "" if world is None else world.robot
    possible = [*dict.fromkeys(chain.from_iterable(map(_holding_needs_a_pick, spoken_of)))]
    reasoner = Reasoner([*spoken_of, *possible], moves, start)
    return reasoner.trace([*wanted, *finally_], always=[*always, *possible], shortest=True)


def _conjuncts(formula: Formula) -> Iterator[Formula]:
    """Split a formula into parts that must all hold, since small formulas are easier to reason about."""
    match formula:
        case And(parts):
            yield from chain.from_iterable(map(_conjuncts, parts))
        case Not(Or(parts)):
            yield from chain.from_iterable(_conjuncts(Not(part)) for part in parts)
        case _:
            yield formula


def _rooms(formulas: Iterable[Formula], world: World) -> Iterator[str]:
    """Yield the name of each room and, for a regex, also words for the room that formulas tell apart."""
    names = [room.name for room in world.rooms]
    spoken_of = [*chain.from_iterable(map(elements, formulas))]
    named_texts: list[TextPattern] = [one.text for one in spoken_of if one.kind == GOTO]
    named_texts += [Regex(one.place_regex.pattern) for one in spoken_of if one.place_regex is not None]
    for name in names:
        yield name
        for word in distinct_strings((Regex(name), *dict.fromkeys(named_texts))):
            names_it = name_of(name, word) != name and meant_by(word, names) == [name]
            if names_it and any(text.matches(word) != text.matches(name) for text in named_texts):
                yield word


def _holding_needs_a_pick(formula: Formula) -> Iterator[Formula]:
    """Yield formulas which say that the robot must pick up each thing before it can hold the thing."""
    for element in elements(formula):
        if element.holding is not None:
            held = EventPattern(element.kind, Regex(".*"), holding=element.holding)
            since = (Scope("AfterLast", EventPattern(PLACE, Regex(".*"))),)
            yield Or((Not(Last(held)), Exists(EventPattern(PICK, element.holding), since)))


# --- two rules


def _pair_warnings(one: Rule, other: Rule, world: World | None) -> Iterator[tuple[Rule, str]]:
    """Yield each likely mistake in a pair of rules, with the rule to which it belongs."""
    kinds = [{element.kind for element in elements(rule.formula)} for rule in (one, other)]
    if not kinds[0] & kinds[1]:
        return
    try:
        if _conflict(one, other, world):
            yield other, f'this rule cannot be kept together with "{one.name}"'
            return
        follows = [_follows(one, other, world), _follows(other, one, world)]
    except Undecided:
        return
    if all(follows):
        yield other, f'this rule is equivalent to "{one.name}"'
    elif follows[0]:
        yield one, f'this rule follows from "{other.name}"'
    elif follows[1]:
        yield other, f'this rule follows from "{one.name}"'


def _conflict(one: Rule, other: Rule, world: World | None) -> bool:
    happens = [ANY_EVENT] if one.when == other.when == "always" else []
    alone = all(_trace(happens, [rule], world) is not None for rule in (one, other))
    return alone and _trace(happens, [one, other], world) is None


def _follows(rule: Rule, other: Rule, world: World | None) -> bool:
    """Whether a rule can be broken, but only together with another rule."""
    if ORDER.index(rule.when) < ORDER.index(other.when):
        return False
    breaks = [Not(rule.formula)]
    return _trace(breaks, [], world) is not None and _trace(breaks, [other], world) is None


# --- names


def _unknown_names(rule: Rule, world: World | None) -> Iterator[str]:
    """Yield a sentence for each room, thing or person that a rule names but the world does not have."""
    if world is None:
        return
    yield from unknown_rooms_in(rule, [room.name for room in world.rooms])
    known = [*map(re.escape, world.descriptions), *WORDS_FOR_PEOPLE]
    known += [label for room in world.rooms for label in room.objects]
    known += [person.name for room in world.rooms for person in room.people]
    for element in dict.fromkeys(elements(rule.formula)):
        row = by_event(element.kind)
        sort = row.recording.names if row is not None and row.recording is not None else ""
        for text in (element.holding, element.to, element.text if "object" in sort else None):
            if isinstance(text, Regex) and not may_mean(text.pattern, known):
                yield f'this rule names "{text.pattern}", which is not in this world'
