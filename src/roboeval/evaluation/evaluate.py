"""Judges a run's completions, and continues an earlier evaluation if the suite and the tool are unchanged."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from typing import Any

from codebotler import __version__
from codebotler.core.errors import UserError
from codebotler.core.files import Appender, to_text, write_whole
from codebotler.core.skills.files import files_of
from codebotler.core.skills.paper import SKILLS
from codebotler.core.text.words import brief
from roboeval.evaluation.engines.engine import PYTHON_VERSION, Local, OpenEngine
from roboeval.evaluation.judging.judge import judgements
from roboeval.evaluation.judging.serialization import row_line
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.folder import RunFolder, evaluation_key, load_json_object, selected_tasks
from roboeval.evaluation.runs.rows import Row, Seal, decode_row, is_sealed, read_lines_of, take_judged
from roboeval.suites.load import Suite


def evaluate_run(
    run: RunFolder,
    suite: Suite,
    *,
    ablated: bool,
    tasks: frozenset[str] | None,
    redo: bool,
    workers: int = 1,
    engine: OpenEngine | None = None,
    completions: Iterable[Completion] | None = None,
) -> Iterator[Row]:
    """Judge the completions of a run that have no row yet, and yield all rows of `tasks` (None means all).

    Rows of other tasks are kept, but `redo` first deletes all rows. If `ablated`, only the common-sense
    requirements of the tasks apply. Programs run in `engine` or, without one, in `workers` processes here. A
    completion that takes too long to judge gets no row, so that the next evaluation tries again. Pass
    `completions` if the run has already been read. Raises UserError if earlier rows were judged by another
    suite, or by other versions of codebotler or Python.
    """
    key = evaluation_key(suite, ablated=ablated)
    with run.writing():
        run.rows(key).parent.mkdir(exist_ok=True)
        if redo:
            for path in (run.rows(key), run.manifest(key)):
                path.unlink(missing_ok=True)
        was = expect_same_judge(run, suite, ablated=ablated)
        before = frozenset() if was is None else selected_tasks(was)
        every = None if tasks is None or before is None else tasks | before
        about = evaluation_metadata(suite, ablated=ablated, tasks=every)
        if was is None:
            write_whole(run.manifest(key), to_text(about))
        left = {one.key: one for one in (run.read(suite) if completions is None else completions)}
        with contextlib.closing(Appender(run.rows(key))) as rows:
            seal = Seal()
            for line in read_lines_of(rows.path, was or {}, seal=seal):
                take_judged(left, line, rows.path)
                if _is_in(line.row["task"], tasks):
                    yield line.row
            left = {key: one for key, one in left.items() if _is_in(one.task, selected_tasks(about))}
            if was is not None and is_sealed(was) and (left or seal.is_broken(was)):
                write_whole(run.manifest(key), to_text(about))
            wanted = [one for one in left.values() if _is_in(one.task, tasks)]
            for completion, judgement in judgements(
                wanted, suite, ablated=ablated, engine=engine or Local(workers)
            ):
                if judgement is None:
                    continue
                row = row_line(completion, judgement)
                rows.append(row)
                seal.add(row)
                del left[completion.key]
                yield decode_row(row)
            finished = {**about, **seal.data()}
            if not left and finished != was:
                rows.sync()
                write_whole(run.manifest(key), to_text(finished))


def _is_in(task: str, tasks: frozenset[str] | None) -> bool:
    return tasks is None or task in tasks


def evaluation_metadata(
    suite: Suite, *, ablated: bool = False, tasks: frozenset[str] | None = None
) -> dict[str, Any]:
    """Return the content of KEY.json: the suite, the tool and Python versions, and `tasks` (None: all)."""
    house = suite.house
    return {
        "suite": suite.name,
        "version": suite.version,
        "digest": suite.digest,
        "worlds": suite.worlds,
        "seed": suite.seed,
        "rules": json.loads(json.dumps(asdict(suite.settings), default=str)),
        "house_rules": None if house is None else {house.name or suite.name: house.digest},
        "skills": None if suite.skills is SKILLS else files_of(suite.skills),
        "codebotler": __version__,
        "python": PYTHON_VERSION,
        "ablation": ablated,
        "tasks": None if tasks is None else sorted(tasks),
    }


def expect_same_judge(run: RunFolder, suite: Suite, *, ablated: bool) -> dict[str, Any] | None:
    """Return the content of KEY.json, or None if absent. Raise UserError if suite or versions differ."""
    key = evaluation_key(suite, ablated=ablated)
    path, rows = run.manifest(key), run.rows(key)
    if not path.exists():
        if rows.exists() and rows.stat().st_size:
            sentence = "this file, which describes the evaluation, is missing; use --redo to judge again"
            raise UserError(sentence, file=path)
        return None
    was = load_json_object(path)
    for name, now in evaluation_metadata(suite, ablated=ablated, tasks=None).items():
        if was.get(name) != now and name != "tasks":
            change = f'"{name}" was {_brief(was.get(name))} and is now {_brief(now)}'
            raise UserError(f"the run was judged differently: {change}; use --redo to judge again", file=path)
    return was


def _brief(value: object) -> str:
    return brief(json.dumps(value))
