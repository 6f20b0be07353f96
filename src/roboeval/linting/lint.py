"""Finds faults in tasks: requirements that can never decide anything, and checks that nothing uses or trips.

Whether a requirement is `unsatisfiable` or `implied` is decided by RTL alone, for all sequences of
events (see `codebotler.rtl.reasoning`), first with visits that name one room of the
world each, then with any. Only a text unlike all samples, or an option that is no text, could refute such a
finding.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations

from codebotler.badinput import YamlFile
from codebotler.cachedproperty import cached_property
from codebotler.english import listed
from codebotler.rtl import Claim, Element, Formula, Not, Number, Regex, Text, Without, Words
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.rtl.reasoning.automaton import Undecided
from codebotler.rtl.reasoning.regex_samples import samples
from codebotler.rtl.reasoning.sample_strings import can_match, distinct_strings
from codebotler.rtl.reasoning.satisfiability import Reasoner
from codebotler.simulator.robot import resolve_room, whole_words
from codebotler.world import World
from roboeval.evaluation.failures import failure
from roboeval.linting.backtracking import slow_text
from roboeval.linting.findings import Finding, Kind
from roboeval.linting.names import absent_names
from roboeval.linting.trials import Verdicts
from roboeval.suites.load import Check, Requirement, Scenario, Task
from roboeval.suites.solutions import solutions


def lint(task: Task, verdicts: Sequence[Verdicts]) -> list[Finding]:
    """Look for mistakes in a task.

    Args:
        task: the task.
        verdicts: on programs that are meant to be right or wrong.
    """
    places = [_Place(task, where, number, scenario) for where, number, scenario in _scenarios(task)]
    found = [*_unused(task), *_unsaid(task), *_slow(task)]
    found += [*_misjudged(task, verdicts), *_untripped(task, verdicts)]
    if task.drawn:
        found += _of_drawn(places)
    else:
        found += [*_same_worlds(task), *(finding for place in places for finding in place.findings())]
    distinct = {(finding.name, finding.line): finding for finding in reversed(found)}
    ordered = sorted(distinct.values(), key=lambda finding: (finding.line or 0, finding.name))
    reasons = {accepted.finding: accepted.because for accepted in task.accepted}
    return [*(replace(one, accepted=reasons.get(one.name)) for one in ordered), *_stale(ordered, task)]


# --- worlds that are drawn

_MOST_DRAWN = 6
"""In how many worlds that require different things the logic of drawn ones is looked at."""

_MOST_ALIKE = 5
"""How many of the requirements that one line of `require` makes by its `for` the logic looks at."""


def _of_drawn(places: Sequence[_Place]) -> Iterator[Finding]:
    """Findings in drawn worlds, of which many require the same; what is implied is so in all looked at.

    That somebody is absent says nothing there, since the requirements are computed from who is present.
    Of requirements that differ only in what a `for` names, such as fifteen times of day, a few stand for all:
    the texts that tell all of them apart are more than could be tried.
    """
    different = [*{frozenset(r.formula for r in p.scenario.require): p for p in reversed(places)}.values()]
    seen: set[str] = set()
    for place in different:
        for requirement in place.scenario.require:
            if requirement.text not in seen:
                seen.add(requirement.text)
                yield from place.dead(requirement)
    implied: dict[int | None, list[Finding]] = {}
    needed: set[int | None] = set()
    for place in map(_with_few_alike, different[::-1][:_MOST_DRAWN]):
        found = [*place.logic()]
        yield from (one for one in found if one.kind != "implied")
        subjects = {one.subject for one in found if one.kind == "implied"}
        needed |= {r.line for r in place.scenario.require if r.text not in subjects}
        for one in found:
            if one.kind == "implied":
                implied.setdefault(one.line, []).append(one)
    yield from (several[0] for line, several in implied.items() if line not in needed)


def _with_few_alike(place: _Place) -> _Place:
    alike: defaultdict[int | None, list[Requirement]] = defaultdict(list)
    for requirement in place.scenario.require:
        alike[requirement.line].append(requirement)
    few = tuple(one for several in alike.values() for one in several[:_MOST_ALIKE])
    return replace(place, scenario=replace(place.scenario, require=few))


# --- the task as a whole


def _scenarios(task: Task) -> Iterator[tuple[str, int, Scenario]]:
    for number, scenario in enumerate(task.scenarios, 1):
        yield f"world {number}", number, scenario
    for number, scenario in enumerate(task.ablation or (), 1):
        yield f"the ablation of world {number}", number, scenario


def _line_of_world(task: Task, number: int) -> int | None:
    return YamlFile.read(task.path).line(("worlds", number - 1))


def _unused(task: Task) -> Iterator[Finding]:
    used = {requirement.check for *_, scenario in _scenarios(task) for requirement in scenario.require}
    for check in task.checks:
        if check.name not in used:
            message = f'no world requires the check "{check.name}"; require it or remove it'
            yield Finding("unused", check.name, message, task.path, check.line)


@dataclass(frozen=True)
class Searched:
    """A regex that is looked for in what a program says.

    Args:
        pattern: as it is looked for.
        where: by which requirement, or in which world.
        line: where that stands.
    """

    pattern: str
    where: str
    line: int | None


def regexes(task: Task) -> Iterator[Searched]:
    """The regexes of a task: those of its requirements, and what its worlds call things and answer."""
    lines = {check.name: check.line for check in task.checks}
    scenarios = [*_scenarios(task)]
    for requirement in {one.text: one for *_, scenario in scenarios for one in scenario.require}.values():
        for element in elements(requirement.formula):
            texts = (text for text in (element.text, element.options, element.answer) if text is not None)
            for pattern in (one for text in texts for one in _compiled(text)):
                yield Searched(pattern, f'"{requirement.text}"', lines[requirement.check])
    labels = {label: (where, n) for where, n, scenario in scenarios for label in _labels(scenario.world)}
    for label, (where, number) in labels.items():
        yield Searched(whole_words(label), where, None if task.drawn else _line_of_world(task, number))


def _labels(world: World) -> Iterator[str]:
    for room in world.rooms:
        yield from (room.name, *room.objects)
        for person in room.people:
            answers = (*person.answers, *chain.from_iterable(person.topics))
            yield from (text for text in (person.name, *answers) if isinstance(text, str))


def _compiled(text: Text) -> Iterator[str]:
    match text:
        case Words(parts):
            yield from chain.from_iterable(map(_compiled, parts))
        case Number():
            yield from (kind.pattern for kind in text.kinds)
        case Regex() | Without() | Claim():
            yield text.compiled.pattern


def _slow(task: Task) -> Iterator[Finding]:
    """Regexes that make the judge slow: the time that it takes to find them grows faster than the text."""
    distinct = {one.pattern: one for one in reversed([*regexes(task)])}
    for pattern, one in distinct.items():
        if (text := slow_text(pattern)) is not None:
            message = (
                f"finding the regex {pattern!r} of {one.where} takes much longer the longer a text is, "
                f"such as {text.prefix + text.unit!r} with {text.unit!r} many times more; let no two repeats "
                "match the same text"
            )
            yield Finding("slow-regex", pattern, message, task.path, one.line)


def _unsaid(task: Task) -> Iterator[Finding]:
    """Facts that a prompt does not tell the model, or tells it although they are to be common sense."""
    if task.borrows:
        return
    file = YamlFile.read(task.path)
    for number, fact in enumerate(task.facts):
        for prompt, text in enumerate(task.prompts):
            word = next((word for word in fact.words if re.search(word, text, re.IGNORECASE)), None)
            if word is None and not fact.commonsense:
                wrong = f'does not say "{fact.fact}", by none of its words; say it'
            elif word is not None and fact.commonsense:
                wrong = f'says "{fact.fact}" by "{word}", but that is to be common sense; leave it out'
            else:
                continue
            line = file.line(("facts", number))
            yield Finding("unsaid", fact.fact, f"prompt {prompt} {wrong}", task.path, line)


def _misjudged(task: Task, verdicts: Sequence[Verdicts]) -> Iterator[Finding]:
    """Solutions that end otherwise than their file says."""
    if task.borrows:  # programs that were written for other requirements
        return
    for solution, judged in zip(solutions(task), verdicts, strict=False):  # an ablation's come afterwards
        failed = failure(judged)
        if (None if failed is None else failed.kind) == solution.fails:
            continue
        said = "pass" if solution.fails is None else f"fail by {solution.fails}"
        where = "" if failed is None else f' by {failed.kind} in the world "{judged[failed.world].world}"'
        message = (
            f'the solution "{solution.about}" is said to {said}, but it '
            f"{'passes' if failed is None else 'fails'}{where}; mend it, what it is said to do, or a check"
        )
        yield Finding("misjudged", solution.about, message, task.path, 1)


def _untripped(task: Task, verdicts: Sequence[Verdicts]) -> Iterator[Finding]:
    wrong = [one for one in verdicts if not all(verdict.satisfied for verdict in one)]
    lines = {check.name: check.line for check in task.checks}
    if not wrong:
        message = f'no wrong program is at hand to show that the checks of "{task.name}" can fail'
        yield Finding("untripped", task.name, message, task.path, 1)
        return
    tripped = {_side(requirement) for one in wrong for verdict in one for requirement in verdict.failed}
    no_program = (
        "the only wrong program of the task does not trip"
        if len(wrong) == 1
        else f"none of the {len(wrong)} wrong programs of the task trips"
    )
    required = [r for *_, scenario in _scenarios(task) for r in scenario.require]
    sides = {_side(r): r for r in reversed(required)}
    for side, requirement in sides.items():
        if side not in tripped:
            meant = ' where it is required without "not"' if f"not {side}" in sides else ""
            message = f'{no_program} "{side}"{meant}; add one that does'
            yield Finding("untripped", side, message, task.path, lines[requirement.check])


def _side(requirement: Requirement) -> str:
    """The name of a check, with `not` where it is required not to hold."""
    return f"not {requirement.check}" if requirement.text.strip().startswith("not ") else requirement.check


def _same_worlds(task: Task) -> Iterator[Finding]:
    for ablated in (False, True):
        worlds = enumerate(task.judged_in(ablated=ablated), 1)
        for (one, first), (other, second) in combinations(worlds, 2):
            if _require_the_same(first, second):
                where = "the ablation of world" if ablated else "world"
                message = (
                    f'{where} {other} ("{second.world.about}") requires the same as '
                    f'{where} {one} ("{first.world.about}")'
                )
                subject = f"{'ablation ' if ablated else ''}{one} and {other}"
                yield Finding("same-worlds", subject, message, task.path, _line_of_world(task, other))


def _require_the_same(one: Scenario, other: Scenario) -> bool:
    """Whether no sequence of events satisfies one and not the other; they may be written differently.

    Of two that nothing satisfies this is not said, unless they are written alike.
    """
    first, second = ({r.formula: None for r in scenario.require} for scenario in (one, other))
    if first.keys() == second.keys():
        return True
    reasoner = Reasoner([*first, *second])
    try:
        return reasoner.conflict([*first]) is None and all(
            reasoner.trace([*held, Not(denied)]) is None
            for held, others in ((first, second), (second, first))
            for denied in others
            if denied not in held
        )
    except Undecided:
        return False


# --- one world


@dataclass(frozen=True)
class _Place:
    """A world of a task, and what is said about its requirements."""

    task: Task
    where: str
    number: int
    scenario: Scenario

    def findings(self) -> Iterator[Finding]:
        for requirement in self.scenario.require:
            yield from self.dead(requirement)
            yield from self.absent(requirement)
        yield from self.logic()

    def finding(self, kind: Kind, subject: str, message: str, line: int | None) -> Finding:
        return Finding(kind, subject, message, self.task.path, line)

    # --- requirements together

    def logic(self) -> Iterator[Finding]:
        rest = [*self.scenario.require]
        try:
            while (clash := self.clash([r.formula for r in rest])) is not None:
                involved = [r for r in rest if r.formula in clash[0]]
                yield self.unsatisfiable(involved, clash[1])
                rest = [r for r in rest if r not in involved]
        except Undecided:
            line = _line_of_world(self.task, self.number)
            yield self.undecided(self.where, f"whether {self.where} can be satisfied", line)
        for requirement in rest:
            yield from self.implied(requirement, [r for r in rest if r is not requirement])

    def unsatisfiable(self, involved: Sequence[Requirement], condition: str) -> Finding:
        subject = " and ".join(r.text for r in involved)
        together = "" if len(involved) == 1 else " together"
        message = f'no text was found with which "{subject}" can hold{together} in {self.where}{condition}'
        line = involved[-1].line if condition or together else self.line_of_fault(involved[0])
        return self.finding("unsatisfiable", subject, message, line)

    def implied(self, requirement: Requirement, others: Sequence[Requirement]) -> Iterator[Finding]:
        subject, line = requirement.text, requirement.line
        try:
            clash = self.clash([r.formula for r in others], requirement.formula)
        except Undecided:
            yield self.undecided(subject, f'whether "{subject}" is implied in {self.where}', line)
            return
        if clash is not None:
            reasons = [f'"{r.text}"' for r in others if r.formula in clash[0]]
            unless = f" without breaking {'one of ' * (len(reasons) > 1)}{listed(reasons)}" if reasons else ""
            message = (
                f'no sequence of the texts that were tried breaks "{subject}" in {self.where}{unless}'
                f"{clash[1]}; it may never be the only one to fail"
            )
            fault = line if reasons or clash[1] else self.line_of_fault(requirement)
            yield self.finding("implied", subject, message, fault)

    def line_of_fault(self, requirement: Requirement) -> int | None:
        """Where to mend what is wrong in any world: the check, unless arguments may be to blame."""
        check = self.check(requirement)
        return requirement.line if check.parameters else check.line

    def check(self, requirement: Requirement) -> Check:
        return next(check for check in self.task.checks if check.name == requirement.check)

    def undecided(self, subject: str, what: str, line: int | None) -> Finding:
        return self.finding("undecided", subject, f"{what} would take too long to find out", line)

    def clash(
        self, formulas: Sequence[Formula], denied: Formula | None = None
    ) -> tuple[list[Formula], str] | None:
        """Formulas that clash, or imply the denied one, and the condition on which they do."""
        clash = self.plain_moves.conflict(formulas, denied)
        if clash is None:
            return None
        always = self.any_moves.conflict(formulas, denied)
        return (clash, _PLAIN) if always is None else (always, "")

    @cached_property
    def any_moves(self) -> Reasoner:
        return Reasoner(r.formula for r in self.scenario.require)

    @cached_property
    def plain_moves(self) -> Reasoner:
        moves = {request: resolve_room(self.rooms, request) or request for request in self.requests}
        formulas = (r.formula for r in self.scenario.require)
        return Reasoner(formulas, moves, self.scenario.world.robot)

    @cached_property
    def requests(self) -> list[str]:
        """For each room a request that leads there and, as far as possible, is no more than its name."""
        rooms = self.rooms
        return [next((t for t in samples(r) if resolve_room(rooms, t) == r), r) for r in rooms]

    # --- regexes

    @cached_property
    def rooms(self) -> list[str]:
        return [room.name for room in self.scenario.world.rooms]

    def dead(self, requirement: Requirement) -> Iterator[Finding]:
        line = self.check(requirement).line
        for element in dict.fromkeys(elements(requirement.formula)):
            for text in _texts(element):
                subject = f"{text} in {requirement.check}"
                if not can_match(text, outer=text is element.options):
                    message = f'no text was found that matches {text}, for which "{requirement.check}" looks'
                    yield self.finding("dead-regex", subject, message, line)
                elif element.kind == "goto" and not self.leads_somewhere(text):
                    there = f'in "{requirement.check}" and gets anywhere in {self.where}'
                    message = f"no visit was found that matches {text} {there}"
                    yield self.finding("dead-regex", subject, message, line)

    def leads_somewhere(self, text: Text) -> bool:
        if any(map(text.matches, self.requests)):
            return True
        others = distinct_strings((text, *map(Regex, self.rooms)))
        return any(text.matches(one) and resolve_room(self.rooms, one) for one in others)

    def absent(self, requirement: Requirement) -> Iterator[Finding]:
        for what, name in absent_names(requirement, self.scenario, self.task):
            message = f'"{requirement.text}" is about the {what} "{name}", but {self.where} has none'
            yield self.finding("absent", f"{name} in {requirement.text}", message, requirement.line)


def _texts(element: Element) -> list[Text]:
    return [element.text] if element.options is None else [element.text, element.options]


_PLAIN = ", as long as each visit names one room of the world"


# --- accepted findings


def _stale(findings: Sequence[Finding], task: Task) -> Iterator[Finding]:
    names = {finding.name for finding in findings}
    for index, accepted in enumerate(task.accepted):
        if accepted.finding not in names:
            line = YamlFile.read(task.path).line(("accepted", index))
            message = f'"{accepted.finding}" is accepted but not found; remove the entry'
            yield Finding("stale-acceptance", accepted.finding, message, task.path, line)
