"""The linter: all findings about a task, in order, and which of them its file accepts."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations

from codebotler.core.yaml_files import YamlFile
from roboeval.linting.findings import Finding
from roboeval.linting.task_findings import task_findings
from roboeval.linting.trials import Verdicts
from roboeval.linting.world_findings import JudgedWorld, judged_worlds
from roboeval.suites.load import Requirement, Task

_MOST_SAMPLED = 6  # sampled worlds with different requirements to search for conflicts and implications
_MOST_ALIKE = 5  # requirements that a single `for` generates


def lint(task: Task, verdicts: Sequence[Verdicts]) -> list[Finding]:
    """Find likely mistakes in a task, given the verdicts on its solutions."""
    worlds = [*judged_worlds(task)]
    found = [*task_findings(task, verdicts)]
    if task.is_sampled:
        found += _lint_sampled([asked for world in worlds for asked in world.by_prompt()])
    else:
        found += [*_same_worlds(worlds), *(finding for world in worlds for finding in _lint_listed(world))]
    distinct = {(finding.name, finding.line): finding for finding in reversed(found)}
    ordered = sorted(distinct.values(), key=lambda finding: (finding.line or 0, finding.name))
    reasons = {accepted.finding: accepted.because for accepted in task.accepted}
    return [*(replace(one, accepted=reasons.get(one.name)) for one in ordered), *_stale(ordered, task)]


def _stale(findings: Iterable[Finding], task: Task) -> Iterator[Finding]:
    names = {finding.name for finding in findings}
    for index, accepted in enumerate(task.accepted):
        if accepted.finding not in names:
            line = YamlFile.read(task.path).line(("accepted", index))
            message = f'"{accepted.finding}" is accepted but does not occur; remove the entry'
            yield Finding("stale-acceptance", accepted.finding, message, task.path, line)


def _lint_listed(world: JudgedWorld) -> Iterator[Finding]:
    """Findings in a world; a requirement is implied only if it is for each prompt that asks for it."""
    needed: set[str] = set()
    found: list[Finding] = []
    for asked in world.by_prompt():
        several = [*asked.findings()]
        implied = {finding.subject for finding in several if finding.kind == "implied"}
        needed |= {requirement.text for requirement in asked.require} - implied
        found += several
    yield from (one for one in found if one.kind != "implied" or one.subject not in needed)


def _lint_sampled(worlds: Sequence[JudgedWorld]) -> Iterator[Finding]:
    """Findings in sampled worlds; a requirement is implied only if it is in all worlds that are searched.

    Absent people are not reported, since requirements are computed from the people present.
    """
    different = [*{frozenset(r.formula for r in w.require): w for w in reversed(worlds)}.values()]
    first = {
        requirement.text: (world, requirement)
        for world in worlds[::-1]
        for requirement in world.require[::-1]
    }
    for world, requirement in first.values():
        yield from world.dead_regexes(requirement)
    implied: dict[int | None, Finding] = {}
    needed: set[int | None] = set()
    for world in map(_with_few_alike, different[::-1][:_MOST_SAMPLED]):
        found = [*world.logic()]
        yield from (one for one in found if one.kind != "implied")
        redundant = {one.subject: one for one in found if one.kind == "implied"}
        needed |= {r.line for r in world.require if r.text not in redundant}
        for one in redundant.values():
            implied.setdefault(one.line, one)
    yield from (one for line, one in implied.items() if line not in needed)


def _with_few_alike(world: JudgedWorld) -> JudgedWorld:
    """Keep few of the requirements that one `for` generates, since the search grows with their number."""
    alike: defaultdict[int | None, list[Requirement]] = defaultdict(list)
    for requirement in world.require:
        alike[requirement.line].append(requirement)
    few = tuple(one for several in alike.values() for one in several[:_MOST_ALIKE])
    return replace(world, scenario=replace(world.scenario, require=few))


def _same_worlds(worlds: Sequence[JudgedWorld]) -> Iterator[Finding]:
    for first, second in combinations(worlds, 2):
        required = [{requirement.formula for requirement in world.require} for world in (first, second)]
        if first.ablated == second.ablated and required[0] == required[1]:
            message = (
                f'{second.name} ("{second.scenario.world.about}") has the same requirements as '
                f'{first.name} ("{first.scenario.world.about}"); change or remove one'
            )
            subject = f"{'ablation ' if first.ablated else ''}{first.number} and {second.number}"
            yield second.finding("same-worlds", subject, message, second.line)
