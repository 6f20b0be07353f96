"""Measures how much more often programs pass if a simulated person answers one question about them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from random import Random
from statistics import fmean
from typing import Any, TypedDict

import msgspec

from codebotler.candidates.clusters import cluster_candidates
from codebotler.candidates.question import question_about
from codebotler.checking.sampled import CheckSettings
from codebotler.core.errors import UserError
from codebotler.core.files import read_text, to_text, write_whole
from codebotler.simulator.engine import digest
from codebotler.simulator.pool import WorkerPool
from roboeval.evaluation.engines.engine import Local
from roboeval.evaluation.judging.judge import evaluate
from roboeval.evaluation.runs.completions import Completion, CompletionKey
from roboeval.evaluation.runs.folder import RunFolder, evaluation_key
from roboeval.evaluation.runs.replies import reply_numbers
from roboeval.evaluation.runs.results import Results
from roboeval.evaluation.runs.rows import key_of
from roboeval.suites.load import Suite

DRAWS_PER_PROMPT = 20
"""The number of groups of candidates that `clarify` samples for each prompt."""


@dataclass(frozen=True)
class ClarifySettings:
    """The settings of `clarify`, which lets a simulated person choose among programs.

    Args:
        candidates: the number of programs to choose from with one question, at least 2.
        noise: the share of questions that the simulated person answers wrongly.
        seed: the random seed for the choice of the programs and for the answers.
    """

    candidates: int = 10
    noise: float = 0.0
    seed: int = 0


class ClarifyShares(TypedDict):
    """Pass rates from 0 to 1 without a clarifying question (`one`, `majority`) and with it (`question`).

    `majority` takes a program with the most frequent behaviour. `mattered` is the share of questions whose
    answer leads to a different verdict than `majority`, or None if no question was asked.
    """

    one: float  # the share of single candidates that pass
    majority: float  # the share of groups in which the program of the largest cluster passes
    question: float  # the share of groups that pass after their question, or without one if none is asked
    asked: float  # the share of groups with a question
    mattered: float | None
    tokens: float | None  # the mean number for a group; None if the run does not count tokens


class PromptShares(ClarifyShares):
    """The `ClarifyShares` of one prompt, identified by its task and its index in the task."""

    task: str
    prompt: int


class ClarifyMeasurement(ClarifyShares):
    """A result of `roboeval clarify`, with its settings and the hashes of the suite and the completions."""

    digest: str
    completions: str
    candidates: int
    noise: float
    seed: int
    prompts: list[PromptShares]


def clarify(
    completions: Iterable[Completion], suite: Suite, pool: WorkerPool, settings: ClarifySettings
) -> Iterator[PromptShares]:
    """Yield pass rates with and without a clarifying question, for each prompt with enough completions.

    A question is about programs that behave differently in imagined worlds. The worlds of the task are used
    only for verdicts and by the simulated person, who chooses the first program that passes.

    Raises:
        UserError: no prompt has `settings.candidates` completions, or a completion is an agent's mission.
    """
    by_prompt = _by_prompt(completions, settings.candidates)
    every = [one for some in by_prompt.values() for one in some]
    passed = {key_of(row): bool(row["passed"]) for row in evaluate(every, suite, engine=Local(pool))}
    groups = {key: _draw_groups(key, some, settings) for key, some in by_prompt.items()}
    how = CheckSettings(seed=settings.seed, skills=suite.skills, house_rules=suite.house_rules)
    offers = pool.map_distinct(
        lambda some: [_offer(pool, how, programs) for programs in some],
        [tuple(one.program for one in group) for some in groups.values() for group in some],
        name=lambda programs: digest(*sorted(programs)),
    )
    for (task, prompt), some in groups.items():
        random = Random(f"answers {settings.seed} {task} {prompt}")  # noqa: S311 - not for cryptography
        trials = [_trial(group, next(offers), passed, random, settings.noise) for group in some]
        changed = [question != majority for _, majority, question, asked in trials if asked]
        yield {
            "task": task,
            "prompt": prompt,
            "one": fmean(one for one, *_ in trials),
            "majority": fmean(majority for _, majority, *_ in trials),
            "question": fmean(question for *_, question, _ in trials),
            "asked": len(changed) / len(trials),
            "mattered": fmean(changed) if changed else None,
            "tokens": _tokens(by_prompt[task, prompt], settings),
        }


def _by_prompt(completions: Iterable[Completion], least: int) -> dict[tuple[str, int], list[Completion]]:
    found: dict[tuple[str, int], list[Completion]] = {}
    for one in completions:
        if one.mission is not None:
            raise UserError("the completions are missions of an agent; choose a run with programs")
        found.setdefault((one.task, one.prompt), []).append(one)
    if not (enough := {key: some for key, some in sorted(found.items()) if len(some) >= least}):
        most = max(map(len, found.values()), default=0)
        needed = f"each question needs {least} completions"
        raise UserError(f"{needed}, but no prompt has more than {most}; lower --candidates")
    return enough


def _draw_groups(
    key: tuple[str, int], some: Sequence[Completion], settings: ClarifySettings
) -> list[list[Completion]]:
    random = Random(f"groups {settings.seed} {key[0]} {key[1]}")  # noqa: S311 - not for cryptography
    return [random.sample(some, settings.candidates) for _ in range(DRAWS_PER_PROMPT)]


def _offer(pool: WorkerPool, settings: CheckSettings, programs: Sequence[str]) -> list[str]:
    """Return the program of the largest cluster, followed by those of the question, if there is one."""
    groups = cluster_candidates(pool.here(), programs, settings)
    question = question_about(groups)
    options = () if question is None else question.options
    return [groups.clusters[0].program, *(one.program for one in options)]


def _trial(
    group: Sequence[Completion],
    offer: Sequence[str],
    passed: Mapping[CompletionKey, bool],
    random: Random,
    noise: float,
) -> tuple[float, bool, bool, bool]:
    """Return the share that passes, the verdicts without and with the question, and whether it is asked."""
    passes = {one.program: passed.get(one.key, False) for one in group}  # no verdict if judging took too long
    one = fmean(passes[each.program] for each in group)
    majority, *answers = (passes[program] for program in offer)
    if not answers:
        return one, majority, majority, False
    chosen = answers.index(True) if any(answers) else None
    if random.random() < noise:
        chosen = random.choice([choice for choice in (*range(len(answers)), None) if choice != chosen])
    return one, majority, chosen is not None and answers[chosen], True


def _tokens(some: Sequence[Completion], settings: ClarifySettings) -> float | None:
    counts = [reply_numbers(one)[name] or 0 for one in some for name in ("input_tokens", "output_tokens")]
    return settings.candidates * sum(counts) / len(some) if any(counts) else None


# --- measurements that are stored in a run


def measurement_data(
    completions: Iterable[Completion],
    suite: Suite,
    settings: ClarifySettings,
    prompts: Sequence[PromptShares],
) -> dict[str, Any]:
    """Return the result of `roboeval clarify` as JSON data: settings, shares of each prompt, and means."""
    questions = [(one["asked"], one["mattered"]) for one in prompts if one["mattered"] is not None]
    asked = sum(share for share, _ in questions)
    tokens = [one["tokens"] for one in prompts if one["tokens"] is not None]
    return {
        "suite": suite.name,
        "digest": suite.digest,
        "completions": _hash_of(completions),
        **asdict(settings),
        "one": fmean(one["one"] for one in prompts),
        "majority": fmean(one["majority"] for one in prompts),
        "question": fmean(one["question"] for one in prompts),
        "asked": fmean(one["asked"] for one in prompts),
        "mattered": sum(share * mattered for share, mattered in questions) / asked if questions else None,
        "tokens": fmean(tokens) if tokens else None,
        "prompts": prompts,
    }


def store_measurement(run: RunFolder, suite: Suite, data: dict[str, Any]) -> Path:
    """Store the `measurement_data` in a run, in a file named after the settings. Return the file's path."""
    name = "candidates-{candidates:02}-noise-{noise}-seed-{seed}.json".format_map(data)
    path = run.questions(evaluation_key(suite, ablated=False)) / name
    write_whole(path, to_text(data))
    return path


def read_measurements(results: Results) -> Iterator[tuple[ClarifyMeasurement, bool]]:
    """Yield each stored measurement of a run, with False if the completions or suite have changed since."""
    for path in sorted(results.run.questions(results.key or "").glob("*.json")):
        try:
            one = msgspec.json.decode(read_text(path), type=ClarifyMeasurement)
        except (msgspec.DecodeError, RecursionError):
            mend = "is not a result of `roboeval clarify`; remove the file and run the command again"
            raise UserError(mend, file=path) from None
        now = results.manifest.get("digest"), _hash_of(results.completions.values())
        yield one, (one["digest"], one["completions"]) == now


def _hash_of(completions: Iterable[Completion]) -> str:
    return digest(*(f"{one.key} {one.program_sha256}" for one in completions)).hex()
