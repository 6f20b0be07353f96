"""Checks the programs of a run and saves the results, so that each program is checked only once."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, TypeAlias

from codebotler import __version__
from codebotler.checking.check import check_together
from codebotler.checking.problems import CheckResult
from codebotler.checking.sampled import CheckSettings
from codebotler.core.files import Appender, to_line, to_text, write_whole
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.room_map import RoomMap
from roboeval.evaluation.engines.engine import PYTHON_VERSION, OpenEngine, Work
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.folder import RunFolder, evaluation_key, load_json_object
from roboeval.evaluation.runs.rows import read_checks
from roboeval.suites.load import Suite

ProgramKey: TypeAlias = tuple[str, str]  # the name of a task and the hash of a program


def check_programs(
    run: RunFolder, suite: Suite, completions: Iterable[Completion], engine: OpenEngine
) -> Iterator[tuple[ProgramKey, list[str]]]:
    """Yield (task, hash) of each distinct program, and its problems as sentences ([] if it is accepted).

    Programs that this run has checked already are not checked again. The check uses the rooms of the task's
    first world and the suite's house rules.
    """
    settings = CheckSettings(simulation=suite.settings, skills=suite.skills, house_rules=suite.house_rules)
    metadata = {
        "suite": suite.name,
        "digest": suite.digest,
        "samples": settings.samples,
        "seed": settings.seed,
        "codebotler": __version__,
        "python": PYTHON_VERSION,
    }
    if suite.house is not None:
        metadata["house_rules"] = suite.house.digest
    evaluation = evaluation_key(suite, ablated=False)
    with run.writing(), contextlib.closing(_open_checks(run, evaluation, metadata)) as file:
        known = dict(read_checks(file.path))
        programs = {(c.task, c.program_sha256): c.program for c in completions}
        yield from ((key, known[key]) for key in programs if key in known)
        new = {key: program for key, program in programs.items() if key not in known}
        if not new:
            return
        plans = {task.name: RoomMap.of(task.scenarios[0].world) for task in suite.tasks.values()}
        check = partial(_check, plans, settings)
        works = ((task, program) for (task, _), program in new.items())
        with engine as opened:
            for key, problems in zip(new, opened.map_distinct(check, works, _problem_sentences), strict=True):
                file.append(to_line({"task": key[0], "program_sha256": key[1], "problems": problems}))
                yield key, problems


def _open_checks(run: RunFolder, key: str, metadata: dict[str, Any]) -> Appender:
    rows, about = run.checks(key), run.checks(key).with_suffix(".json")
    about.parent.mkdir(exist_ok=True)
    if not about.exists() or load_json_object(about) != metadata:
        rows.unlink(missing_ok=True)
        write_whole(about, to_text(metadata))
    return Appender(rows)


def _check(
    plans: Mapping[str, RoomMap], settings: CheckSettings, worker: Worker, works: Sequence[Work]
) -> list[CheckResult]:
    return check_together(worker, [(program, plans[task]) for task, program in works], settings)


def _problem_sentences(check: CheckResult) -> list[str]:
    return [problem.sentence for problem in check.problems]
