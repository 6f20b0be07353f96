"""Decide whether to ask a person which behaviour they meant, and hold the question."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial, reduce
from itertools import chain, groupby
from operator import and_, itemgetter
from typing import Any, Literal, TypeAlias

from codebotler.candidates.behaviour import Behaviour, count_in_other_rooms, people_sought, rooms_with_several
from codebotler.candidates.clusters import (
    CandidateCluster,
    CandidateClusters,
    conflicts_in_worlds,
    distinct_clusters,
    main_reason,
)
from codebotler.checking.problems import Sample
from codebotler.checking.storyboard import steps_of
from codebotler.core.errors import UserError
from codebotler.core.skills.kinds import ASK, CHECK, GOTO, PICK, PLACE, SAY
from codebotler.core.terminal import shortened
from codebotler.core.text.phrases import bracketed, phrase
from codebotler.core.text.words import brief, counted, elide_list, listed
from codebotler.core.trace import Event, Outcome, Status
from codebotler.models.recorded import is_recorded
from codebotler.simulator.worlds.matching import SOMEBODY, normalized
from codebotler.simulator.worlds.sampled_facts import ABSENT_FORM, ANSWER_FORM, PRESENT_FORM, SampledFact

DOMINANT_SHARE = 0.75
"""The largest cluster is taken without a question if it has at least this share of the candidates."""

MAX_QUESTION_FACTS = 4
NOTICED_FIRST = frozenset({"said", "moved", "asked", "room"})
"""The fields of a `Behaviour` that a person cares about most."""

ABSENCE = re.compile('^nobody|" is not in "')
NOTICED_KINDS = frozenset({SAY, ASK, PICK, PLACE})

ClarifyingAnswer: TypeAlias = int | Literal["none", "decide"]
"""The position of an option from 0, `none` to reject them all, or `decide` to leave it to the tool."""


MAX_REASON, BRIEF, COURSE, WHOLE = 160, (4, 70), (20, 200), (1_000, 4_000)
"""Limits for actions, rooms of an action, and characters; `WHOLE` if brief descriptions are equal."""


@dataclass(frozen=True)
class CandidateOption:
    """A program that a person can choose, and how it behaves differently from the other options.

    Args:
        program: the program that the robot would run.
        size: the number of candidates that behave like it, in this world at least.
        steps: its steps in the world of the question, from `steps_of`.
        difference: how it differs from the other options, such as "ends in kitchen".
        course: all that it says, asks and moves, and where it ends.
        own: the numbers, from 1, of the steps that not all options share.
        share: how many candidates behave like it, and whether it may wait without success, in words.
    """

    program: str = field(repr=False)
    size: int
    steps: tuple[Mapping[str, Any], ...] = field(repr=False)
    difference: str
    course: str
    own: frozenset[int] = frozenset()
    share: str = ""


@dataclass(frozen=True)
class ClarifyingQuestion:
    """A question about which of a few behaviours a person meant.

    Args:
        options: two or three options with different behaviours: those that finish, then the most frequent.
        facts: the facts of the imagined world that explain the differences, in words.
        total: the number of accepted candidates.
        sample: the number of the imagined world, from 0.
        rejected: for each candidate that the check rejected, the first problem.
        why_last: why the answer `none` would not lead to new programs; empty if it would.
    """

    options: tuple[CandidateOption, ...]
    facts: tuple[str, ...]
    total: int
    sample: int
    rejected: tuple[str, ...] = ()
    why_last: str = ""

    @property
    def left_out(self) -> str:
        """A sentence about missing candidates: "Not shown: 2 programs that ..."; empty if none is missing."""
        left, rejected = self.total - sum(one.size for one in self.options), len(self.rejected)
        reasons = {
            "that would do something else": left,
            f"that the check rejects{main_reason(self.rejected)}": rejected,
        }
        parts = [f"{counted(number, 'program')} {why}" for why, number in reasons.items() if number]
        return f"Not shown: {listed(parts)}." if parts else ""

    @property
    def legend(self) -> str:
        """A line above the options: "The programs differ as marked, supposing that Anne is in the lab:"."""
        return f"The programs differ{' as marked' * any(one.own for one in self.options)}{self.supposition}:"

    @property
    def supposition(self) -> str:
        """The facts of the world, as in ", supposing that Anne is in the lab"; empty if there are none."""
        return f", supposing that {listed([*map(shortened, self.facts)])}" if self.facts else ""

    @property
    def rejections(self) -> list[str]:
        """Hints for a model, one per option: "the person did not mean a robot that ends in kitchen"."""
        meant = f"the person did not mean{self.supposition}{',' * bool(self.facts)} a robot that"
        return [f"{meant} {one.course}" for one in self.options]

    def chosen(self, answer: ClarifyingAnswer) -> CandidateOption | None:
        """Return the option that an answer selects: the first one for `decide`, and None for `none`."""
        if answer == "none":
            return None
        return self.options[0 if answer == "decide" else answer]

    def record(self, answer: ClarifyingAnswer) -> list[str]:
        """Return log lines about an answer: one for the chosen option, if any, and one per other option."""
        if (option := self.chosen(answer)) is None:
            return self.rejections
        who = "a person left the choice to CodeBotler" if answer == "decide" else "a person chose"
        rest = [f"another option was a robot that {one.course}" for one in self.options if one is not option]
        return [f"{who}{self.supposition}: a robot that {option.course}", *rest]

    def parse(self, line: str) -> ClarifyingAnswer:
        """Read an answer: an option's number from 1, `none` or `you decide`. Raise UserError for others."""
        text = " ".join(line.lower().split()).rstrip(".")
        if text.isdecimal() and 1 <= int(text) <= len(self.options):
            return int(text) - 1
        if text in {"none", "none of these"}:
            return "none"
        if text in {"you decide", "decide"}:
            return "decide"
        numbers = ", ".join(str(number) for number in range(1, len(self.options) + 1))
        raise UserError(f'"{brief(line)}" is not an answer; write {numbers}, "none" or "you decide"')


def question_about(
    groups: CandidateClusters,
    dominant_share: float = DOMINANT_SHARE,
    *,
    model: str = "",
    is_second: bool = False,
) -> ClarifyingQuestion | None:
    """Return a question, or None if one behaviour dominates or all candidates do the same.

    Args:
        groups: the candidates, clustered by behaviour.
        dominant_share: no question is asked if the largest cluster has at least this share of them.
        model: the model that would write other programs.
        is_second: whether the person has already rejected other programs, so that no more can be written.
    """
    largest = groups.clusters[0]
    if len(groups.clusters) == 1 or largest.size >= dominant_share * groups.total:
        return None
    conflicts = conflicts_in_worlds(groups.clusters, groups.people)
    worlds = [number for number, count in conflicts.items() if count == min(conflicts.values())]
    number = max(worlds, key=lambda one: _rank(distinct_clusters(groups.clusters, one), one))
    shown = distinct_clusters(groups.clusters, number)
    shown.sort(key=lambda one: bool(one.behaviours[number].ending))  # those that finish come first
    samples = [one.samples[number] for one in shown]
    behaviours = [one.behaviours[number] for one in shown]
    options = []
    differences = describe_differences(samples, behaviours)
    for one, sample, (words, own) in zip(shown, samples, differences, strict=True):
        behaviour, trace = one.behaviours[number], sample.outcome.trace
        steps = (*steps_of(trace, has_places=True, has_waits=True),)
        size = sum(other.size for other in groups.clusters if other.behaviours[number] == behaviour)
        course = _words(sample.outcome, range(1, len(steps) + 1), {"ending", "room"}, COURSE)
        share = _share(one, size, groups.total)
        options.append(CandidateOption(one.program, size, steps, words, course, own, share))
    why_last = "this is the second question" if is_second else ""
    why_last = "a recorded model writes no new programs" if is_recorded(model) else why_last
    facts = _facts_that_matter(shown, number)
    return ClarifyingQuestion(tuple(options), facts, groups.total, number, groups.rejected, why_last)


def _share(shown: CandidateCluster, size: int, total: int) -> str:
    """Say how many candidates act like a cluster, in all worlds and in this one, and whether it may wait."""
    here = f"; {counted(size - shown.size, 'other')} would do the same here, but not in other worlds"
    is_endless = any(one.in_vain and one.outcome.status is Status.TIMEOUT for one in shown.samples)
    waits = f"; may {'wait or search without end' if is_endless else 'end without success'}"
    share = f"{shown.size} of {counted(total, 'program')}"
    return f"{share}{here * (size > shown.size)}{waits * bool(shown.in_vain)}"


def _rank(shown: Sequence[CandidateCluster], number: int) -> tuple[int, ...]:
    """Rank a world: by the number of options, their candidates, what a person cares about, and brevity.

    Options that all act, but in different rooms, differ more than those that only say something else. Where
    an option searches, or does more, especially the first one, a person sees better what it is for. A thing
    or person that options find in different rooms confuses.
    """
    first, *others = (one.behaviours[number] for one in shown)
    cares = sum(bool(first.differences(other) & NOTICED_FIRST) for other in others)
    traces = [one.samples[number].outcome.trace for one in shown]
    acts = [[(event.kind, event.place) for event in trace if event.kind in NOTICED_KINDS] for trace in traces]
    sizes, apart = sum(one.size for one in shown), all(acts) and sum({*one} != {*acts[0]} for one in acts)
    looks = [[(event.text, event.found) for event in trace if event.kind == CHECK] for trace in traces]
    searches = any((text, False) in some[:n] for some in looks for n, (text, seen) in enumerate(some) if seen)
    actions, brevity = sum(map(len, acts)), -sum(map(len, traces))
    elsewhere = -count_in_other_rooms(traces)
    return len(shown), sizes, cares, elsewhere, apart, searches, len(acts[0]), actions, brevity


def _facts_that_matter(shown: Sequence[CandidateCluster], number: int) -> tuple[str, ...]:
    """Return the facts of a world that do not hold in all worlds where the options look the same."""

    def facts(world: int) -> list[SampledFact]:
        random = ((fact for fact in one.samples[world].facts if fact.is_random) for one in shown)
        drawn = Counter(fact for some in random for fact in dict.fromkeys(some))
        asked = Counter(fact.names[:-1] for fact in drawn if fact.form == ANSWER_FORM)
        # The steps of each option show its answer, if options get different answers to the same words.
        kept = [one for one in drawn if one.form != ANSWER_FORM or asked[one.names[:-1]] == 1]
        # Facts that only some options find out explain best why the options differ.
        kept.sort(key=lambda one: (one.form == ANSWER_FORM, bool(ABSENCE.search(one.sentence))))
        return sorted(kept, key=lambda one: drawn[one] == len(shown))

    same = [world for world in range(len(shown[0].samples)) if len({o.behaviours[world] for o in shown}) == 1]
    alike = [set(facts(world)) for world in same]
    telling = [fact for fact in facts(number) if not alike or not all(fact in one for one in alike)]
    # Where a person is says also where the person is not.
    people = {name for name, _ in people_sought(one.samples[number].outcome.trace for one in shown)}
    known = [one for one in facts(number) if one.form == PRESENT_FORM and one.names[0] in people]
    homes = {one.names[0]: one for one in known}
    telling = [homes.get(one.names[0], one) if one.form == ABSENT_FORM else one for one in telling]
    rooms: dict[str, list[str]] = {}  # of each person or thing that is in several ones
    # The steps of each option show all answers.
    explained = [one for one in telling if one.form != ANSWER_FORM] or telling or facts(number)
    for one in dict.fromkeys(explained):
        is_in = one.form.endswith(' in "{}"')
        what, _, room = one.sentence.rpartition(' "') if is_in else (one.sentence, "", "")
        rooms.setdefault(what, []).append(f'"{room}' * is_in)
    listings = [(what, listed(elide_list(sorted(some), MAX_QUESTION_FACTS))) for what, some in rooms.items()]
    return tuple(elide_list([f"{what} {some}".rstrip() for what, some in listings], MAX_QUESTION_FACTS))


def describe_differences(
    samples: Sequence[Sample], behaviours: Sequence[Behaviour]
) -> list[tuple[str, frozenset[int]]]:
    """Return how each run differs, such as `ends in kitchen`, and the numbers of the steps that differ.

    All runs are in the same world. Steps are counted from 1; those that all runs share are left out.
    """
    said, traces = [one.said for one in behaviours], [one.outcome.trace for one in samples]
    rooms = {room for one in said for other in said for room, _ in one - other}  # where statements differ
    several = rooms_with_several(traces)
    keys = [[_noticed(event, rooms, several) for event in trace] for trace in traces]
    for some, trace in zip(keys, traces, strict=True):
        for last in [number for number, one in enumerate(trace) if one.destination is not None][-1:]:
            some[last] = GOTO, trace[last].destination
    shared = reduce(and_, map(Counter, keys))
    own = [
        frozenset(n for n, key in enumerate(some, 1) if key and some[:n].count(key) > shared[key])
        for some in keys
    ]
    differ = {name for one in behaviours for name in one.differences(behaviours[0])}
    acts = any(trace[n - 1].kind != GOTO for some, trace in zip(own, traces, strict=True) for n in some)
    # Where all questions offer the same, their options tell nothing apart.
    if len({key[3:] for key in chain(*keys) if key[:1] == (ASK,)}) == 1:
        traces = [tuple(replace(event, options=()) for event in trace) for trace in traces]
    runs = [replace(one.outcome, trace=trace) for one, trace in zip(samples, traces, strict=True)]
    words: list[str] = []
    for limits in (BRIEF, WHOLE):
        words = [_words(one, each, differ, limits, is_less=acts) for one, each in zip(runs, own, strict=True)]
        if len({*words}) == len(words):
            break
    return [*zip(words, own, strict=True)]


def _noticed(event: Event, rooms: Container[str], several: Container[str]) -> tuple[object, ...]:
    """Return what a person would notice of an event, as in a `Behaviour`; empty for drives and looks."""
    if event.kind == ASK:
        person = normalized(event.to or "") if event.place in several else ""
        return ASK, event.place, person, *sorted(normalized(text) for text, _ in event.options)
    is_hidden = event.kind in {GOTO, CHECK} or (event.kind == SAY and event.place not in rooms)
    return () if is_hidden else (event.kind, event.place, normalized(event.text), *event.more)


def _words(
    run: Outcome,
    own: Container[int],
    differ: Container[str],
    limits: tuple[int, int],
    *,
    is_less: bool = False,
) -> str:
    """Describe the own acts of a run, and how and where it ends.

    If it has no own acts, describe all of them, after `only` if it `is_less` than another option.
    """
    numbered = [*enumerate(run.trace, 1)]
    others = {_act(one, limits) for number, one in numbered if number not in own}
    acts = [one for number, one in numbered if number in own and one.kind != GOTO]
    parts, error = _acts(acts, limits, others), run.error
    if not acts:
        acts = [one for one in run.trace if one.kind not in {GOTO, CHECK}]
        idle = "drives and looks" if run.trace else "does nothing"
        parts = _acts(acts, limits) or [idle]
        parts[0] = f"{'only ' * (is_less and bool(run.trace))}{parts[0]}"
    if "ending" in differ and error is not None:
        reason = brief(error.message, MAX_REASON)
        is_limit = run.status is Status.TIMEOUT
        parts.append(f"does not finish {f'within {reason}' if is_limit else f'({reason})'}")
    rooms = [one.destination for one in run.trace if one.destination is not None]
    if "room" in differ and rooms and (not acts or acts[-1].place != rooms[-1]):
        parts.append(f"{'ends' if error is None else 'is then'} in {rooms[-1]}")
    return listed(parts)


def _acts(
    events: Iterable[Event], limits: tuple[int, int], others: Container[tuple[str, ...]] = ()
) -> list[str]:
    """Describe actions, each with its rooms: `says "Lunch!" in lab and den`, after `also` if in `others`."""
    rooms: dict[tuple[str, ...], Counter[str]] = {}  # of each act
    for one in events:
        rooms.setdefault(_act(one, limits), Counter())[one.place] += 1
    acts = []
    for act, counts in rooms.items():
        places = [f"{room} {count} times" if count > 1 else room for room, count in counts.items()]
        where = f"{act[2]} in {listed(elide_list(places, limits[0]))}"
        acts.append((f"{'also ' * (act in others)}{act[0]}", where, act[1]))
    together = [(*key, [one[2] for one in same]) for key, same in groupby(acts, key=itemgetter(0, 1))]
    found = [f"{verb}{listed(elide_list(objects, limits[0]))}{where}" for verb, where, objects in together]
    return elide_list(found, limits[0])


def _act(event: Event, limits: tuple[int, int]) -> tuple[str, str, str]:
    """Return the verb, the object, and what comes after it: `asks `, `"Tea?"` and ` [yes | no] of "Ann"`."""
    show = partial(brief, most=limits[1])
    verb, quote, rest = phrase(replace(event, options=()), "third", show=show).partition('"')
    person = f' of "{brief(event.to)}"' if event.to and normalized(event.to) != SOMEBODY else ""
    return verb, f"{quote}{rest}", f"{bracketed(event, show)}{person}"
