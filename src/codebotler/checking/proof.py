"""Extend a check by an exploration: the contract of the program, and what is proved of each house rule."""

from __future__ import annotations

from dataclasses import replace

from codebotler.checking.contracts.of_program import derive_contract
from codebotler.checking.contracts.text import contract_clauses
from codebotler.checking.exploration import explore
from codebotler.checking.problems import CheckResult, Problem, RuleProof, RuleVerdict
from codebotler.checking.sampled import CheckSettings, SampledRuns, group_failures
from codebotler.checking.source.written_arguments import read_arguments
from codebotler.core.skills.table import SkillTable
from codebotler.simulator.guard.contract import Contract
from codebotler.simulator.worker import Worker


def extend_check(worker: Worker, program: str, found: CheckResult, settings: CheckSettings) -> CheckResult:
    """Return a check with the contract of the program, a proof for each rule, and the problems that it shows.

    Args:
        worker: a worker that no other thread uses.
        program: the program.
        found: the result of its check; without a run, it is returned unchanged.
        settings: the settings of the check.
    """
    if not found.samples:
        return found
    explored = explore(worker, program, found.room_map, settings)
    written = read_arguments(program, settings.skills)
    is_complete = explored.is_complete and explored.is_steady and not written.reads_clock
    samples, problems, proofs = list(found.samples), list(found.problems), []
    for rule in settings.house_rules:
        sampler = explored.violations.get(rule.name)
        number = next((one.samples[0] for one in found.problems if one.rule == rule.name), None)
        if sampler is not None and number is None:
            how = replace(settings, house_rules=(rule,), strict=sampler.strict)
            number = len(samples)
            runs = SampledRuns(program, found.room_map, [sampler], how)
            samples.append(replace(runs.samples_on(worker, {})[0], number=number, is_chosen=True))
            problems += group_failures(samples[number:], found.room_map)
        verdict: RuleVerdict = "possible" if number is not None else "never" if is_complete else "unknown"
        proofs.append(RuleProof(rule.name, verdict, explored.cases, number))
    if any(not problem.rule for problem in problems):  # a robot may get further than these runs
        explored = replace(explored, is_complete=False)
    contract = derive_contract(explored, written, found.room_map, settings.skills)
    problems.sort(key=lambda problem: problem.line or 0)
    return replace(
        found,
        problems=tuple(problems),
        samples=tuple(samples),
        proofs=tuple(proofs),
        contract=contract,
    )


def hold_within(found: CheckResult, allowed: Contract, skills: SkillTable) -> CheckResult:
    """Return a check with a problem for each skill with which the program may do what a contract forbids."""
    if found.contract is None:
        return found
    new = contract_clauses(found.contract.beyond(allowed), skills)
    problems = (
        Problem("OutsideContract", f"the program may {clause}, which the contract does not allow")
        for clause in new
    )
    return replace(found, problems=(*found.problems, *problems))
