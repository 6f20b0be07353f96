"""Finds likely mistakes in the requirements of one world: conflicts, implications and dead regexes.

`codebotler.rtl.reasoning` decides whether requirements are unsatisfiable or implied. It assumes that
each drive is one of the requests that lead to a room of the world.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from codebotler.core.cachedproperty import cached_property
from codebotler.core.text.words import listed
from codebotler.core.yaml_files import YamlFile
from codebotler.rtl import Regex, TextPattern
from codebotler.rtl.reasoning import Reasoner, Undecided
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.rtl.reasoning.regex_samples import samples
from codebotler.rtl.reasoning.sample_strings import can_match, distinct_strings
from codebotler.simulator.worlds.matching import Matching, resolve_room
from roboeval.linting.absent_names import absent_names
from roboeval.linting.findings import Finding, FindingKind
from roboeval.suites.load import Requirement, Scenario, Task


@dataclass(frozen=True)
class JudgedWorld:
    """A world of a task, or of its ablation, with methods that find mistakes in its requirements."""

    task: Task
    number: int  # the number of the world, from 1
    scenario: Scenario
    ablated: bool
    matching: Matching = "label-in-request"  # how requests refer to rooms

    @property
    def name(self) -> str:
        """The name of the world for messages, such as `world 2` or `the ablation of world 2`."""
        return f"{'the ablation of ' if self.ablated else ''}world {self.number}"

    @property
    def require(self) -> tuple[Requirement, ...]:
        """The requirements that programs must satisfy in the world."""
        return self.scenario.require

    @property
    def line(self) -> int | None:
        """The line of the world in the task file, from 1, or None if the file is empty."""
        return YamlFile.read(self.task.path).line(("worlds", self.number - 1))

    def finding(self, kind: FindingKind, subject: str, message: str, line: int | None) -> Finding:
        """Create a finding about this world's task. `subject` identifies it among those of its kind."""
        return Finding(kind, subject, message, self.task.path, line)

    def findings(self) -> Iterator[Finding]:
        """Yield likely mistakes in this world's requirements that need no comparison with other worlds."""
        for requirement in self.require:
            yield from self.dead_regexes(requirement)
            for what, name in absent_names(requirement, self.scenario, self.task):
                message = f'"{requirement.text}" names the {what} "{name}", which {self.name} lacks'
                yield self.finding("absent", f"{name} in {requirement.text}", message, requirement.line)
        yield from self.logic()

    def logic(self) -> Iterator[Finding]:
        """Yield findings about requirements that cannot hold, or that follow from others."""
        rest = [*self.require]
        try:
            while (conflict := self._reasoner.conflict([r.formula for r in rest])) is not None:
                involved = [r for r in rest if r.formula in conflict]
                subject = " and ".join(r.text for r in involved)
                together = "" if len(involved) == 1 else " together"
                message = f'"{subject}" probably cannot hold{together} in {self.name}'
                yield self.finding("unsatisfiable", subject, message, involved[-1].line)
                rest = [r for r in rest if r not in involved]
        except Undecided:
            yield self._undecided(self.name, f"whether {self.name} can be satisfied", self.line)
        for requirement in rest:
            yield from self._implied(requirement, [r for r in rest if r is not requirement])

    def _implied(self, requirement: Requirement, others: Sequence[Requirement]) -> Iterator[Finding]:
        subject, line = requirement.text, requirement.line
        try:
            premises = self._reasoner.conflict([r.formula for r in others], requirement.formula)
        except Undecided:
            yield self._undecided(subject, f'whether "{subject}" is implied in {self.name}', line)
            return
        if premises is not None:
            reasons = [f'"{r.text}"' for r in others if r.formula in premises]
            unless = f" without breaking {'one of ' * (len(reasons) > 1)}{listed(reasons)}" if reasons else ""
            message = f'"{subject}" in {self.name} may be redundant: no run was found that breaks it{unless}'
            yield self.finding("implied", subject, message, line)

    def _undecided(self, subject: str, what: str, line: int | None) -> Finding:
        return self.finding("undecided", subject, f"{what} takes too long to decide", line)

    @cached_property
    def _reasoner(self) -> Reasoner:
        moves = {request: self._room_for(request) or request for request in self._requests}
        return Reasoner((r.formula for r in self.require), moves, self.scenario.world.robot)

    def _room_for(self, request: str) -> str | None:
        return resolve_room(self._rooms, request, self.matching)

    @cached_property
    def _rooms(self) -> tuple[str, ...]:
        return tuple(room.name for room in self.scenario.world.rooms)

    @cached_property
    def _requests(self) -> list[str]:
        """Return a short request for each room that makes the robot drive there."""
        return [next((t for t in samples(r) if self._room_for(t) == r), r) for r in self._rooms]

    def dead_regexes(self, requirement: Requirement) -> Iterator[Finding]:
        """Yield findings about regexes that match no text, and regexes for drives that match no room."""
        line = next(check.line for check in self.task.checks if check.name == requirement.check)
        for element in dict.fromkeys(elements(requirement.formula)):
            for text in [element.text] if element.options is None else [element.text, element.options]:
                subject = f"{text} in {requirement.check}"
                if not can_match(text, outer=text is element.options):
                    message = f'no text was found that matches {text} in "{requirement.check}"'
                    yield self.finding("dead-regex", subject, message, line)
                elif element.kind == "goto" and not self._leads_somewhere(text):
                    message = f'no room of {self.name} was found that matches {text} in "{requirement.check}"'
                    yield self.finding("dead-regex", subject, message, line)

    def by_prompt(self) -> list[JudgedWorld]:
        """Return a copy of this world for each prompt, with only its requirements. Omit duplicates."""
        asked = {self.scenario.asked_by(prompt): None for prompt in range(len(self.task.prompts))}
        return [replace(self, scenario=scenario) for scenario in asked]

    def _leads_somewhere(self, text: TextPattern) -> bool:
        if any(map(text.matches, self._requests)):
            return True
        others = distinct_strings((text, *map(Regex, self._rooms)))
        return any(text.matches(one) and self._room_for(one) for one in others)


def judged_worlds(task: Task, matching: Matching = "label-in-request") -> Iterator[JudgedWorld]:
    """Yield the worlds of a task, then those of its ablation, which require only common sense."""
    for ablated in (False, True):
        for number, scenario in enumerate(task.judged_in(ablated=ablated), 1):
            yield JudgedWorld(task, number, scenario, ablated, matching)
