"""Finds likely mistakes in a task as a whole: in its checks, facts, regexes and solutions."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import TypeAlias

from codebotler.core.text.words import counted
from codebotler.core.trace import Outcome
from codebotler.core.yaml_files import YamlFile
from codebotler.rtl import Claim, Number, Regex, TextPattern, Without, Words
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.rtl.reasoning.backtracking import slow_text
from codebotler.rtl.regex_words import UNCLEAR
from codebotler.rtl.wording import is_clear
from codebotler.simulator.pool import WorkerPool
from roboeval.evaluation.judging.failures import Verdict, failure_of_verdicts
from roboeval.evaluation.judging.judge import judge, run_in
from roboeval.evaluation.runs.rows import Failure
from roboeval.linting.clauses import uncovered_clauses
from roboeval.linting.findings import Finding
from roboeval.linting.world_findings import judged_worlds
from roboeval.suites.load import Requirement, Scenario, Suite, Task
from roboeval.suites.solutions import locate_solution, solutions
from roboeval.suites.task import plain_check

Verdicts: TypeAlias = Sequence[Verdict]  # verdicts on a program in all worlds of a task or of its ablation


def task_findings(task: Task, verdicts: Sequence[Verdicts]) -> Iterator[Finding]:
    """Yield likely mistakes in a task as a whole. `verdicts` come from `judge_solutions`."""
    yield from (*_unused(task), *_unsaid(task), *_uncovered(task), *_slow(task), *_unworded(task))
    yield from (*_misjudged(task, verdicts), *_untripped(task, verdicts))


def _required(task: Task) -> list[Requirement]:
    return [requirement for world in judged_worlds(task) for requirement in world.require]


def _unused(task: Task) -> Iterator[Finding]:
    used = {requirement.check for requirement in _required(task)}
    for check in task.checks:
        if check.name not in used:
            message = f'no world requires the check "{check.name}"; require it or remove it'
            yield Finding("unused", check.name, message, task.path, check.line)


def _unsaid(task: Task) -> Iterator[Finding]:
    """Yield a finding for each fact that a prompt omits, or that it mentions although it is common sense."""
    file = YamlFile.read(task.path)
    own = len(file.data.get("facts", ())) if isinstance(file.data, dict) else 0
    for number, fact in enumerate(task.facts[len(task.facts) - own :]):
        for prompt, text in enumerate(task.prompts):
            word = next((word for word in fact.words if re.search(word, text, re.IGNORECASE)), None)
            if word is None and not fact.commonsense:
                wrong = f'contains none of the words for "{fact.fact}"; add one of them'
            elif word is not None and fact.commonsense:
                wrong = f'mentions "{fact.fact}" by "{word}", a fact marked as common sense; remove the words'
            else:
                continue
            line = file.line(("facts", number))
            yield Finding("unsaid", fact.fact, f"prompt {prompt} {wrong}", task.path, line)


def _uncovered(task: Task) -> Iterator[Finding]:
    """Yield a finding for each fact or clause that no check covers, if the task has `covered_by`."""
    if not task.covered_by:
        return
    line = YamlFile.read(task.path).line(("covered_by",))
    for fact in task.facts:
        if fact.fact not in dict(task.covered_by):
            message = f'covered_by lacks the fact "{fact.fact}"; add it'
            yield Finding("uncovered", fact.fact, message, task.path, line)
    for prompt, clause in uncovered_clauses(task):
        message = f'no check covers "{clause}" in prompt {prompt}; add a fact with these words'
        yield Finding("uncovered", f"{prompt}: {clause}", message, task.path, line)


def _unworded(task: Task) -> Iterator[Finding]:
    unclear = {
        requirement.check
        for requirement in _required(task)
        if not all(map(is_clear, elements(requirement.formula))) or UNCLEAR in plain_check(requirement.text)
    }
    for check in task.checks:
        if check.name in unclear:
            message = f'a regex of the check "{check.name}" cannot be described'
            mend = 'add its meaning under "means"'
            yield Finding("unworded", check.name, f"{message}; {mend}", task.path, check.line)


def _misjudged(task: Task, verdicts: Sequence[Verdicts]) -> Iterator[Finding]:
    if task.borrows:  # borrowed programs were written for other requirements
        return
    # Ignore the verdicts in the worlds of an ablation, which follow.
    for solution, judged in zip(solutions(task), verdicts, strict=False):
        failed = _by_some_prompt(judged, len(task.prompts))
        if (None if failed is None else failed["kind"]) == solution.fails:
            continue
        expected = "pass" if solution.fails is None else f"fail by {solution.fails}"
        where = "" if failed is None else _why(failed, judged)
        message = (
            f'the solution "{solution.about}" should {expected}, but it '
            f"{'passes' if failed is None else 'fails'}{where}; correct the program, its `fails`, or a check"
        )
        path, line = locate_solution(task, solution)
        yield Finding("misjudged", solution.about, message, path, line)


def _why(failed: Failure, judged: Verdicts) -> str:
    by = failed["kind"] if failed["check"] is None else f'{failed["kind"]}, by "{failed["check"]}",'
    return f' by {by} in world {failed["world"] + 1}, "{judged[failed["world"]].world}"'


def _by_some_prompt(verdicts: Verdicts, prompts: int) -> Failure | None:
    """Return the failure of a program, or None if the program satisfies at least one prompt."""
    by_prompt = ([verdict.on(prompt) for verdict in verdicts] for prompt in range(prompts))
    failures = [*map(failure_of_verdicts, by_prompt)]
    return None if None in failures else failures[0]


def _untripped(task: Task, verdicts: Sequence[Verdicts]) -> Iterator[Finding]:
    """Yield a finding for each check, or its negation by `not`, that no wrong solution fails."""
    wrong = [one for one in verdicts if not all(verdict.satisfied for verdict in one)]
    if not wrong:
        message = f'"{task.name}" has no wrong solution to show that its checks can fail; add one'
        yield Finding("untripped", task.name, message, task.path, 1)
        return
    tripped = {_side(requirement) for one in wrong for verdict in one for requirement in verdict.failed}
    no_program = f"none of {counted(len(wrong), 'incorrect program')} fails by"
    lines = {check.name: check.line for check in task.checks}
    sides = {_side(requirement): requirement for requirement in reversed(_required(task))}
    for side, requirement in sides.items():
        if side not in tripped:
            meant = ' without "not"' if f"not {side}" in sides else ""
            message = f'{no_program} "{side}"{meant}; add an incorrect program that does'
            yield Finding("untripped", side, message, task.path, lines[requirement.check])


def _side(requirement: Requirement) -> str:
    return f"not {requirement.check}" if requirement.text.strip().startswith("not ") else requirement.check


def _slow(task: Task) -> Iterator[Finding]:
    for pattern, requirement in searched_regexes(task).items():
        if (text := slow_text(pattern)) is not None:
            message = (
                f'searching the regex {pattern!r} of "{requirement.text}" is slow for long texts, such as '
                f"one that begins with {text!r}; avoid overlapping repetitions"
            )
            check = next(check for check in task.checks if check.name == requirement.check)
            yield Finding("slow-regex", pattern, message, task.path, check.line)


def searched_regexes(task: Task) -> dict[str, Requirement]:
    """Map each regex that is used to judge programs to the first requirement that uses it."""
    found: dict[str, Requirement] = {}
    for requirement in {one.text: one for one in _required(task)}.values():
        for element in elements(requirement.formula):
            texts = (text for text in (element.text, element.options, element.answer) if text is not None)
            for pattern in chain.from_iterable(map(_compiled, texts)):
                found.setdefault(pattern, requirement)
    return found


def _compiled(text: TextPattern) -> Iterator[str]:
    match text:
        case Words(parts):
            yield from chain.from_iterable(map(_compiled, parts))
        case Number():
            yield from (kind.pattern for kind in text.kinds)
        case Regex() | Without() | Claim():
            yield text.compiled.pattern


def judge_solutions(task: Task, suite: Suite, *, workers: int = 1) -> list[Verdicts]:
    """Run all solutions of a task in its worlds, then in those of its ablation. Return the verdicts."""
    judges = [worlds for worlds in (task.scenarios, task.ablation) if worlds]
    runs = [(solution.program, worlds) for worlds in judges for solution in solutions(task)]
    with WorkerPool(workers) as pool:

        def outcomes(program: str, worlds: Sequence[Scenario]) -> list[Outcome]:
            return run_in(pool.here(), program, worlds, suite)

        ran = [pool.submit(outcomes, *each) for each in runs]
        return [
            [judge(outcome, scenario) for outcome, scenario in zip(one.result(), worlds, strict=True)]
            for one, (_, worlds) in zip(ran, runs, strict=True)
        ]
