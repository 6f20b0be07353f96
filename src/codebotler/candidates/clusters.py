"""Cluster candidate programs by their behaviour in the same imagined worlds."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

from codebotler.candidates.behaviour import (
    Behaviour,
    behaviour_of,
    count_conflicts,
    names_in,
    people_sought,
    rooms_with_several,
)
from codebotler.checking.check import check_on
from codebotler.checking.problems import CheckResult, Sample
from codebotler.checking.sampled import (
    CheckSettings,
    SampledRuns,
    first_samplers,
    run_together,
    unexplored_samplers,
)
from codebotler.checking.source.static import read_rooms
from codebotler.core.terminal import shortened
from codebotler.core.text.words import counted
from codebotler.simulator.pool import shared_pool
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.fact_sampler import Draw, FactSampler
from codebotler.simulator.worlds.matching import SOMEBODY, contains, normalized
from codebotler.simulator.worlds.room_map import RoomMap

RANDOM_WORLDS, MAX_SHARED_WORLDS = 8, 24  # random worlds, and worlds with those that try further facts
SETTLED_WORLDS = 16  # added if candidates contradict each other in any of these
MAX_CANDIDATE_OPTIONS = 3
ROOM_NUMBER = re.compile(r"\s*\d+$")


@dataclass(frozen=True)
class CandidateCluster:
    """Candidate programs that behave alike in all shared imagined worlds.

    Args:
        programs: the different programs, beginning with the most frequent one.
        size: the number of candidates; equal programs count separately.
        behaviours: the behaviour of the first program in each world.
        samples: the runs of the first program in each world.
    """

    programs: tuple[str, ...] = field(repr=False)
    size: int
    behaviours: tuple[Behaviour, ...] = field(repr=False)
    samples: tuple[Sample, ...] = field(repr=False)

    @property
    def program(self) -> str:
        """The most frequent program, which represents the cluster."""
        return self.programs[0]

    @property
    def in_vain(self) -> int:
        """The number of worlds in which the program waits or searches without success."""
        return sum(sample.in_vain for sample in self.samples)

    def extended(self, samples: Sequence[Sample], behaviours: Sequence[Behaviour]) -> CandidateCluster:
        """Return a copy with runs of the first program in further worlds, and their behaviours."""
        runs, all_behaviours = (*self.samples, *samples), (*self.behaviours, *behaviours)
        numbered = tuple(replace(sample, number=number) for number, sample in enumerate(runs))
        return replace(self, samples=numbered, behaviours=all_behaviours)


@dataclass(frozen=True)
class CandidateClusters:
    """The clusters of the candidates that the check accepts, with the largest one first.

    Args:
        clusters: at least one. If the check rejects all candidates, the only cluster has the first of them.
        rejected: for each rejected candidate that is not in a cluster, the first problem.
        people: the names of the people on the map, in lower case and without articles.
    """

    clusters: tuple[CandidateCluster, ...]
    rejected: tuple[str, ...] = ()
    people: frozenset[str] = frozenset()

    @property
    def total(self) -> int:
        """The number of candidates in all clusters."""
        return sum(one.size for one in self.clusters)

    @property
    def summary(self) -> str:
        """A phrase about the chosen program: "took the most frequent behaviour: 3 of 4 programs"."""
        some, largest, total = self.rejected, self.clusters[0], counted(self.total, "program")
        if not largest.samples:
            every = counted(self.total + len(some), "program")
            return f"the check rejected all of {every}; took the first"
        rejected = f"; the check rejected {len(some)}{main_reason(some)}" if some else ""
        if len(self.clusters) == 1:
            return f"all of {total} behave alike{rejected}"
        is_tie = self.clusters[1].size == largest.size  # they are in the order of their sizes
        most = "first of the most frequent behaviours" if is_tie else "most frequent behaviour"
        return f"took the {most}: {largest.size} of {total}{rejected}"


def main_reason(rejected: Sequence[str]) -> str:
    """Return the most frequent problem, such as ` (2 of them: there is no lab)`, or "" if there is none."""
    for problem, count in Counter(rejected).most_common(1):
        some = f"{'all' if count == len(rejected) else count} of them: " * (len(rejected) > 1)
        return f" ({some}{shortened(problem)})"
    return ""


def cluster_candidates(
    worker: Worker, programs: Sequence[str], settings: CheckSettings, room_map: RoomMap | None = None
) -> CandidateClusters:
    """Check candidates, and group the accepted ones by behaviour in imagined worlds.

    Args:
        worker: a worker that no other thread uses.
        programs: the candidates, at least one; equal ones count separately.
        settings: the settings of the check and of the runs.
        room_map: the rooms; by default all rooms that the programs name.
    """
    counts = Counter(programs)
    checks = {program: check_on(worker, program, room_map, settings) for program in counts}
    accepted = [program for program, found in checks.items() if not found.problems]
    first = [one for program in programs for one in checks[program].problems[:1]]
    rejected = tuple(f"{problem.kind}: {problem.message}" for problem in first)
    if not accepted:
        return CandidateClusters((CandidateCluster((programs[0],), 1, (), ()),), rejected[1:])
    rooms = room_map or shared_rooms(accepted, [checks[one] for one in accepted], settings)
    runs = run_in_shared_worlds(worker, accepted, rooms, settings)
    traces = [sample.outcome.trace for samples in runs for sample in samples]
    names, several = names_in((*rooms.rooms, *rooms.people), traces), rooms_with_several(traces)

    def describe(samples: Iterable[Sample]) -> tuple[Behaviour, ...]:
        return tuple(behaviour_of(one.outcome, rooms.start, names, several) for one in samples)

    behaviours = [*map(describe, runs)]
    together: dict[tuple[Behaviour, ...], list[int]] = {}
    for number, seen in enumerate(behaviours):
        together.setdefault(seen, []).append(number)
    clusters = [_cluster(some, accepted, counts, seen, runs) for seen, some in together.items()]
    people = frozenset(map(normalized, rooms.people))
    if any(conflicts_in_worlds(clusters, people).values()):
        more = _run_with_settled_people(worker, clusters, rooms, settings)
        clusters = [one.extended(new, describe(new)) for one, new in zip(clusters, more, strict=True)]
    clusters.sort(key=lambda one: (-one.size, one.in_vain))
    return CandidateClusters(tuple(clusters), rejected, people)


def compare_candidates(
    programs: Sequence[str], settings: CheckSettings, room_map: RoomMap | None = None
) -> CandidateClusters:
    """Check and group candidates as `cluster_candidates` does, on a worker of this process's pool."""
    pool = shared_pool()
    return pool.call(lambda: cluster_candidates(pool.here(), programs, settings, room_map))


def _cluster(
    some: Sequence[int],
    programs: Sequence[str],
    counts: Counter[str],
    behaviours: tuple[Behaviour, ...],
    runs: Sequence[Sequence[Sample]],
) -> CandidateCluster:
    ordered = sorted(some, key=lambda number: -counts[programs[number]])
    size = sum(counts[programs[number]] for number in some)
    samples = tuple(runs[ordered[0]])
    return CandidateCluster(tuple(programs[number] for number in ordered), size, behaviours, samples)


def shared_rooms(programs: Iterable[str], checks: Sequence[CheckResult], settings: CheckSettings) -> RoomMap:
    """Return one map with the rooms of all programs.

    It omits "office" if there is also "ann's office", since both names may mean the same room. If a program
    asks for all rooms, it adds a second room of each kind, which may reveal a mistake in a loop.
    """
    start = checks[0].room_map.start
    events = (event for one in checks for sample in one.samples for event in sample.outcome.trace)
    visited = (event.destination for event in events if event.destination)  # their names may be computed
    every = chain((room for one in checks for room in one.rooms), visited)
    named = dict.fromkeys(normalized(room) for room in every if room != start)
    rooms = [room for room in named if not any(contains(other, room) for other in named if other != room)]
    if any(read_rooms(program, settings.skills)[1] for program in programs):
        kinds = Counter(ROOM_NUMBER.sub("", room) for room in rooms)
        second = {kind: f"{kind} 1" if f"{kind} 2" in rooms else f"{kind} 2" for kind in kinds}
        rooms += [second[kind] for kind, count in kinds.items() if count == 1]
    return replace(checks[0].room_map, rooms=(*rooms, start), start=start)


def run_in_shared_worlds(
    worker: Worker, programs: Sequence[str], room_map: RoomMap, settings: CheckSettings
) -> list[list[Sample]]:
    """Run programs in the same worlds. Return one list per program, with its run in each world.

    The first worlds are random. Later ones try other values of the facts that a program met.
    """
    first = first_samplers(replace(settings, samples=RANDOM_WORLDS))
    new = [replace(sampler, by_options=True) for sampler in first]
    samplers: list[FactSampler] = []
    runs: list[list[Sample]] = [[] for _ in programs]
    while new:
        more = _run_all(worker, programs, room_map, new, settings)
        runs = [[*before, *added] for before, added in zip(runs, more, strict=True)]
        samplers += new
        found = (one for samples in runs for one in unexplored_samplers(samples, samplers))
        new = list(dict.fromkeys(found))[: MAX_SHARED_WORLDS - len(samplers)]
    return [[replace(sample, number=number) for number, sample in enumerate(samples)] for samples in runs]


def distinct_clusters(clusters: Sequence[CandidateCluster], number: int) -> list[CandidateCluster]:
    """Return up to three clusters with different behaviours in a world, with the largest first."""
    different: dict[Behaviour, CandidateCluster] = {}
    for one in clusters:
        different.setdefault(one.behaviours[number], one)
    return [*different.values()][:MAX_CANDIDATE_OPTIONS]


def conflicts_in_worlds(clusters: Sequence[CandidateCluster], people: Container[str] = ()) -> dict[int, int]:
    """Return the number of contradictions between the options of each world where the clusters differ.

    If chance has put some of `people` (normalized names) into rooms, they count as met there.
    """
    conflicts: dict[int, int] = {}
    for number in range(len(clusters[0].samples)):
        if len({one.behaviours[number] for one in clusters}) > 1:
            samples = [one.samples[number] for one in distinct_clusters(clusters, number)]
            homes = _drawn_places(samples, people, results=[1])
            conflicts[number] = count_conflicts((one.outcome.trace for one in samples), homes)
    return conflicts


def _drawn_places(
    samples: Iterable[Sample], people: Container[str], *, results: Container[int]
) -> set[tuple[str, str]]:
    """Return people with the rooms for which it was drawn whether they are there, with one of the results."""
    draws = {draw for sample in samples for draw in sample.draws if draw.method == "is_there"}
    places = ((str(draw.arguments[1]), str(draw.arguments[0]), draw.result) for draw in draws)
    return {(name, room) for name, room, result in places if name in people and result in results}


def _run_with_settled_people(
    worker: Worker, clusters: Sequence[CandidateCluster], room_map: RoomMap, settings: CheckSettings
) -> list[list[Sample]]:
    """Run the first program of each cluster in random worlds where each person is in one room at most."""
    samples = [sample for one in clusters for sample in one.samples]
    places = people_sought(sample.outcome.trace for sample in samples)
    places |= _drawn_places(samples, {*map(normalized, room_map.people)}, results=[0, 1])
    homes: dict[str, list[str]] = {}  # the rooms in which each person may be
    for name, room in sorted(places):
        homes.setdefault(name, []).append(room)
    samplers = []
    for number in range(MAX_SHARED_WORLDS, MAX_SHARED_WORLDS + SETTLED_WORLDS):
        sampler = FactSampler(settings.seed, number, by_options=True, draws_people=True)
        forced: list[Draw] = []
        for name, rooms in homes.items():
            home = rooms[sampler.draw(len(rooms), "home", name)]
            forced += [Draw("is_there", (room, name), int(room == home)) for room in rooms]
            forced.append(Draw("is_there", (home, SOMEBODY), 1))
        samplers.append(replace(sampler, forced=tuple(forced)))
    return _run_all(worker, [one.program for one in clusters], room_map, samplers, settings)


def _run_all(
    worker: Worker,
    programs: Sequence[str],
    room_map: RoomMap,
    samplers: Sequence[FactSampler],
    settings: CheckSettings,
) -> list[list[Sample]]:
    """Run programs, where tame ones share a process, and worlds that repeat a run share its result."""
    runs = [SampledRuns(program, room_map, samplers, settings) for program in programs]
    return [
        [next(one for one in ran if one.would_repeat_in(sampler)) for sampler in samplers]
        for ran in run_together(worker, runs)
    ]
