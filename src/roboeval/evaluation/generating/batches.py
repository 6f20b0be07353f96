"""Writes the requests of a run for a batch endpoint, and imports the endpoint's answers."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from codebotler.core.errors import UserError
from codebotler.core.files import (
    MAX_ROW,
    Appender,
    expect_replaceable,
    open_replacement,
    parse_row,
    read_lines,
    to_line,
    to_text,
    write_whole,
)
from codebotler.models.base import ModelError
from codebotler.models.sampling import SamplingSettings
from codebotler.models.servers.batch import BatchModel
from roboeval.evaluation.generating.generate import reply_of_refusal
from roboeval.evaluation.generating.requests import GenerationPlan, batches, begin_batch
from roboeval.evaluation.runs.completions import CompletionKey, how_many, row_for
from roboeval.evaluation.runs.folder import RunFolder, about_of
from roboeval.evaluation.runs.source import MAX_ANSWER_BYTES
from roboeval.suites.load import Suite

BEGINNING = b'{"custom_id": '
IDENTITY = ("model", "settings", "template", "suite")  # entries of run.json that identify a batch


def write_requests(
    run: RunFolder,
    plan: GenerationPlan,
    model: BatchModel,
    path: Path,
    *,
    progress: Callable[[int], object] = bool,
) -> int:
    """Start a run, write requests for its missing completions to a file, and return the number of requests.

    `progress` is called with the number of requests written so far. Raises UserError if no completion is
    missing, the run was generated with other settings, or an existing file holds anything but requests.
    """
    expect_replaceable(path, BEGINNING)
    with run.writing():
        about, _, todo = begin_batch(run, plan, model.name, model.settings)
        if not todo:
            raise UserError(f"all {how_many(len(plan.keys()))} already exist; request more", file=run.path)
        with open_replacement(path) as file:
            for number, key in enumerate(todo, 1):
                asked = model.request(plan.prompt(key), number=plan.sample(key))
                name = request_id(about, key, plan.instruction(key))
                row = {"custom_id": name, "method": "POST", "url": asked.url, "body": asked.body}
                file.write(to_line(row))
                progress(number)
            Appender(run.completions).close()
            write_whole(run.about, to_text(about))
    return len(todo)


def request_id(about: Mapping[str, Any], key: CompletionKey, instruction: str) -> str:
    """Return a request's name, TASK/PROMPT/INDEX/HASH. Runs with different settings differ in the hash."""
    mark = hashlib.sha256(to_line([*(about.get(name) for name in IDENTITY), instruction])).hexdigest()[:8]
    task, prompt, index = key
    return f"{task}/{prompt}/{index}/{mark}"


@dataclass(frozen=True)
class ImportResult:
    """The numbers of new, expected and missing completions after an import, and why some are missing."""

    new: int  # completions that the import added
    total: int  # completions that the run should have
    missing: int
    why: str  # why a completion is missing, such as the error message of its request


BatchAnswer: TypeAlias = tuple[CompletionKey, int, object]  # to which request, the status, and the body


def import_answers(
    run: RunFolder, suite: Suite, path: Path, *, progress: Callable[[int], object] = bool
) -> ImportResult:
    """Add the completions in a file of answers to the run that `write_requests` started.

    The run keeps its earlier completions. If a request has several replies, the first one counts.
    `progress` is called with the number of answers read so far. Raises UserError, and adds nothing, if the
    run was generated with other settings or a line is not an answer to one of its requests.
    """
    about = _expect_begun(run, suite)
    plans = [_plan(suite, batch) for batch in batches(about)]
    expected = list(dict.fromkeys(key for plan in plans for key in plan.keys()))  # noqa: SIM118 - no mapping
    plan = plans[0]
    ids = {request_id(about, key, plan.instruction(key)): key for key in expected}
    with run.writing():
        there = {completion.key for completion in plan.completed(run)}
        rows: dict[CompletionKey, dict[str, Any]] = {}
        failed: dict[CompletionKey, ModelError] = {}
        with closing(BatchModel(about["model"], SamplingSettings(**batches(about)[-1]["settings"]))) as model:
            for number, (key, status, body) in enumerate(_answers(path, ids), 1):
                if key not in there and key not in rows:
                    try:
                        rows[key] = _row(model, plan, key, status, body)
                    except ModelError as error:
                        failed[key] = error
                progress(number)
        if there or rows:  # the endpoint accepted these, so it refused others because of their content
            for key, refusal in failed.items():
                if refusal.is_refusal and key not in rows:
                    data = reply_of_refusal(refusal).data()
                    rows[key] = row_for(key, plan.instruction(key), about["model"], data)
        with closing(Appender(run.completions)) as file:
            for row in [rows[key] for key in expected if key in rows]:
                file.append(to_line(row))
    missing = [key for key in expected if key not in there and key not in rows]
    reasons = (failed[key].sentence for key in missing if key in failed)
    return ImportResult(len(rows), len(expected), len(missing), next(reasons, "the file has no answer"))


def _row(
    model: BatchModel, plan: GenerationPlan, key: CompletionKey, status: int, body: object
) -> dict[str, Any]:
    """Return the row of an answer. Raise ModelError if it contains no reply, or one that is too long."""
    reply = model.reply(plan.prompt(key), number=plan.sample(key), status=status, body=body)
    row = row_for(key, plan.instruction(key), model.name, reply.data())
    if (size := len(to_line(row))) > MAX_ROW:
        raise ModelError(f"the reply has {size:,} bytes; the limit is {MAX_ROW:,}", is_temporary=False)
    return row


def _expect_begun(run: RunFolder, suite: Suite) -> dict[str, Any]:
    about = about_of(run)
    if not batches(about):
        raise UserError("this run was not started by `generate --requests`; name one that was", file=run.path)
    if about.get("suite") != suite.name:
        sentence = f'belongs to the suite "{about.get("suite")}"; select that suite with --suite'
        raise UserError(sentence, file=run.path)
    return about


def _plan(suite: Suite, batch: Mapping[str, Any]) -> GenerationPlan:
    tasks = batch.get("tasks")
    return GenerationPlan(suite, None if tasks is None else frozenset(tasks), batch["num_completions"])


def _answers(path: Path, ids: Mapping[str, CompletionKey]) -> Iterator[BatchAnswer]:
    for number, line in read_lines(path, limit=MAX_ANSWER_BYTES):
        if not line.strip():
            continue
        try:
            yield _answer(line, ids)
        except UserError as error:
            raise UserError(error.sentence, file=path, line=number) from None


def _answer(line: bytes, ids: Mapping[str, CompletionKey]) -> BatchAnswer:
    row = parse_row(line)
    if row is None:
        raise UserError("this line is not JSON; the file may be incomplete, so download it again")
    key, response, error = ids.get(str(row.get("custom_id"))), row.get("response"), row.get("error")
    if "response" not in row and "error" not in row:
        raise UserError("this line is not an answer from a batch endpoint; choose the endpoint's output file")
    if key is None:
        name = repr(row.get("custom_id"))
        raise UserError(f"the request {name} is of another run or of other settings; name its run with --out")
    if not isinstance(response, dict):
        return key, 200, error
    status, body = response.get("status_code"), response.get("body")
    return key, status if isinstance(status, int) else 200, error if body is None else body
