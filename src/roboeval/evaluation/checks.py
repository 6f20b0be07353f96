"""The problems that checking finds in a run's programs, kept in the run so that each is checked once."""

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
from codebotler.simulator.sampled_robot import RoomMap
from codebotler.simulator.worker import Worker
from roboeval.evaluation.engines import PYTHON_VERSION, OpenEngine, Work
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.folder import Run, evaluation_key, load_head
from roboeval.evaluation.runs.rows import read_checks
from roboeval.suites.load import Suite

ProgramKey: TypeAlias = tuple[str, str]  # a task and the hash of a program


def check_programs(
    run: Run, suite: Suite, completions: Iterable[Completion], engine: OpenEngine, *, samples: int, seed: int
) -> Iterator[tuple[ProgramKey, list[str]]]:
    """Yield the problems of each program, checking those that nobody has checked with these settings.

    Of the world, a check knows the rooms: those of the first world of the task. House rules are the suite's.
    """
    metadata = {
        "suite": suite.name,
        "digest": suite.digest,
        "samples": samples,
        "seed": seed,
        "codebotler": __version__,
        "python": PYTHON_VERSION,
    }
    if suite.house is not None:
        metadata["house_rules"] = suite.house.digest
    with (
        run.writing(),
        contextlib.closing(_open(run, evaluation_key(suite, ablated=False), metadata)) as file,
    ):
        known = dict(read_checks(file.path))
        programs = {(c.task, c.program_sha256): c.program for c in completions}
        yield from ((key, known[key]) for key in programs if key in known)
        new = {key: program for key, program in programs.items() if key not in known}
        if not new:
            return
        plans = {task.name: RoomMap.of(task.scenarios[0].world) for task in suite.tasks.values()}
        settings = CheckSettings(
            samples=samples,
            seed=seed,
            rules=suite.rules,
            skills=suite.skills,
            house_rules=() if suite.house is None else suite.house.rules,
        )
        check = partial(_check, plans, settings)
        works = ((task, program) for (task, _), program in new.items())
        with engine as opened:
            for key, problems in zip(new, opened.map_distinct(check, works, _sentences), strict=True):
                file.append(to_line({"task": key[0], "program_sha256": key[1], "problems": problems}))
                yield key, problems


def _open(run: Run, key: str, metadata: dict[str, Any]) -> Appender:
    rows, about = run.checks(key), run.checks_head(key)
    about.parent.mkdir(exist_ok=True)
    if not about.exists() or load_head(about) != metadata:
        rows.unlink(missing_ok=True)
        write_whole(about, to_text(metadata))
    return Appender(rows)


def _check(
    plans: Mapping[str, RoomMap], settings: CheckSettings, worker: Worker, works: Sequence[Work]
) -> list[CheckResult]:
    return check_together(worker, [(program, plans[task]) for task, program in works], settings)


def _sentences(check: CheckResult) -> list[str]:
    return [problem.sentence for problem in check.problems]
