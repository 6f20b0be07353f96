"""Writes the requests of a run for a batch endpoint, and imports the endpoint's answers."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
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
from codebotler.models.base import ModelError, Reply
from codebotler.models.batch import BatchModel
from codebotler.models.sampling import SamplingSettings
from roboeval.evaluation.generate import reply_of_refusal
from roboeval.evaluation.requests import (
    GenerationPlan,
    add_usage,
    batches,
    no_usage,
    run_metadata,
    timestamp,
    with_batch,
)
from roboeval.evaluation.runs.completions import CompletionKey, how_many, row_for
from roboeval.evaluation.runs.folder import RunFolder, load_json_object
from roboeval.evaluation.runs.source import MAX_ANSWER_BYTES
from roboeval.suites.load import Suite

BEGINNING = b'{"custom_id": '
IDENTITY = ("model", "settings", "template", "suite")  # entries of run.json that identify a batch
REQUEST_ID = re.compile(r"(?P<task>.+)/(?P<prompt>\d{1,9})/(?P<index>\d{1,9})/[0-9a-f]{8}", re.ASCII)


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
        about, keys = run_metadata(run, plan, model.name, model.settings), plan.keys()
        done = {one.key for one in plan.completed(run)}
        todo = [key for key in keys if key not in done]
        if not todo:
            raise UserError(f"already holds all {how_many(len(keys))}", file=run.path)
        about["batches"] = with_batch(about["batches"], plan, model.settings)
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
    """Return a name for a request that is unique among all runs: a hash of its instruction and run.json."""
    mark = hashlib.sha256(to_line([*(about.get(name) for name in IDENTITY), instruction])).hexdigest()[:8]
    task, prompt, index = key
    return f"{task}/{prompt}/{index}/{mark}"


@dataclass(frozen=True)
class ImportResult:
    """The state of a run after an import of answers."""

    new: int  # completions that the import added
    total: int  # completions that the run should have
    failed: Mapping[CompletionKey, str] = field(repr=False)  # errors of the requests that failed
    unanswered: Sequence[CompletionKey] = field(repr=False)  # requests with neither a completion nor an error


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
    ids = {request_id(about, key, plans[0].instruction(key)): key for key in expected}
    with run.writing():
        usage, there = no_usage(), set()
        for completion in plans[0].completed(run):
            there.add(completion.key)
            add_usage(usage, completion.more.get("usage"))
        settings = SamplingSettings(**batches(about)[-1]["settings"])
        with closing(BatchModel(about["model"], settings)) as model:
            found = _Replies(model, plans[0], there)
            for number, (key, status, body) in enumerate(_answers(path, ids), 1):
                found.add(key, status, body)
                progress(number)
            found.keep_refused()
        new = [found.lines[key] for key in expected if key in found.lines]
        missing = [key for key in expected if key not in there and key not in found.lines]
        if new:
            _add(run, about, new, usage, is_whole=not missing)
    failed = {key: found.failed[key] for key in missing if key in found.failed}
    return ImportResult(len(new), len(expected), failed, [key for key in missing if key not in failed])


BatchLine: TypeAlias = tuple[bytes, Mapping[str, Any]]  # a line of completions.jsonl, and its token counts


def _add(
    run: RunFolder, about: dict[str, Any], lines: list[BatchLine], usage: Counter[str], *, is_whole: bool
) -> None:
    with closing(Appender(run.completions)) as file:
        for line, used in lines:
            file.append(line)
            add_usage(usage, used)
    about["usage"] = usage
    if is_whole:
        about["batches"][-1]["ended"] = timestamp()
    write_whole(run.about, to_text(about))


@dataclass
class _Replies:
    """Converts the replies in answers to lines of completions.jsonl."""

    model: BatchModel
    plan: GenerationPlan
    there: set[CompletionKey]  # the completions already in the run
    lines: dict[CompletionKey, BatchLine] = field(default_factory=dict)
    failed: dict[CompletionKey, str] = field(default_factory=dict)
    refused: dict[CompletionKey, ModelError] = field(default_factory=dict)

    def add(self, key: CompletionKey, status: int, body: object) -> None:
        """Add an answer, unless its request already has a reply."""
        if key in self.there or key in self.lines:
            return
        try:
            prompt, number = self.plan.prompt(key), self.plan.sample(key)
            self._keep(key, self.model.reply(prompt, number=number, status=status, body=body))
        except ModelError as error:
            self.failed[key] = error.sentence
            if error.is_refusal:
                self.refused[key] = error

    def keep_refused(self) -> None:
        """Record the requests that the endpoint refused permanently, if it accepted at least one request."""
        if self.there or self.lines:
            for key, error in self.refused.items():
                if key not in self.lines:
                    self._keep(key, reply_of_refusal(error))

    def _keep(self, key: CompletionKey, reply: Reply) -> None:
        row = row_for(key, self.plan.instruction(key), self.model.name, reply.data())
        line = to_line(row)
        if len(line) > MAX_ROW:
            raise ModelError(f"the reply is too long to save: {len(line):,} bytes", may_pass=False)
        self.lines[key] = line, row["usage"]
        self.failed.pop(key, None)


def _expect_begun(run: RunFolder, suite: Suite) -> dict[str, Any]:
    if not run.about.is_file():
        raise UserError(
            "was not started by `roboeval generate --requests`; name the run that was", file=run.path
        )
    about = load_json_object(run.about)
    if not isinstance(about.get("settings"), dict) or not batches(about):
        raise UserError("holds imported completions; name the run that the requests belong to", file=run.path)
    if about.get("suite") != suite.name:
        raise UserError(
            f'belongs to the suite "{about.get("suite")}"; select that suite with --suite', file=run.path
        )
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
        raise UserError("this line is not JSON; the file may be incomplete")
    name = row.get("custom_id")
    if "response" not in row and "error" not in row:
        what = "a request" if "method" in row else "not an answer from a batch endpoint"
        raise UserError(f"this line is {what}; name the file with the answers")
    if not isinstance(name, str) or name not in ids:
        known = isinstance(name, str) and REQUEST_ID.fullmatch(name)
        whose = "of another run or with other settings" if known else "that belongs to no run"
        raise UserError(f"this line answers a request {whose}: {name!r}")
    response, error = row.get("response"), row.get("error")
    if not isinstance(response, dict):
        return ids[name], 200, error
    status, body = response.get("status_code"), response.get("body")
    return ids[name], status if isinstance(status, int) else 200, error if body is None else body
