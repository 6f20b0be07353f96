"""Completions by way of files: the requests of a run for a batch endpoint, and its answers."""

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
from roboeval.evaluation.runs.completions import Key, how_many, reply_row
from roboeval.evaluation.runs.folder import Run, load_head
from roboeval.evaluation.runs.source import LONGEST_ANSWER
from roboeval.suites.load import Suite

BEGINNING = b'{"custom_id": '
IDENTITY = ("model", "settings", "template", "suite")  # entries of run.json
ID = re.compile(r"(?P<task>.+)/(?P<prompt>\d{1,9})/(?P<index>\d{1,9})/[0-9a-f]{8}", re.ASCII)


def write_requests(
    run: Run,
    plan: GenerationPlan,
    model: BatchModel,
    path: Path,
    *,
    progress: Callable[[int], object] = bool,
) -> int:
    """Write requests for the completions that a run lacks, and begin the run; return how many there are.

    Args:
        run: the run in which the answers will be kept.
        plan: the completions that it should have.
        model: the model that is to be asked.
        path: the file of JSON lines to write.
        progress: called with the number of requests that are written, each time that it has grown.

    Raises:
        UserError: no completion is missing, the run is of another kind, or the file holds something else.
    """
    expect_replaceable(path, BEGINNING)
    with run.writing():
        about, keys = run_metadata(run, plan, model), plan.keys()
        done = {one.key for one in plan.completed(run)}
        todo = [key for key in keys if key not in done]
        if not todo:
            raise UserError(f"holds all {how_many(len(keys))} already", file=run.path)
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


def request_id(about: Mapping[str, Any], key: Key, instruction: str) -> str:
    """The name of a request, with a hash of all that it depends on: no other run has the same one.

    Args:
        about: the run.json of its run.
        key: of the completion.
        instruction: the instruction that the completion is for.
    """
    mark = hashlib.sha256(to_line([*(about.get(name) for name in IDENTITY), instruction])).hexdigest()[:8]
    task, prompt, index = key
    return f"{task}/{prompt}/{index}/{mark}"


# --- answers


@dataclass(frozen=True)
class Imported:
    """What a run holds after answers were added.

    Args:
        new: how many completions were added.
        total: how many the run should have.
        failed: the error of each request that failed and has no completion.
        unanswered: the requests that have neither a completion nor an error.
    """

    new: int
    total: int
    failed: Mapping[Key, str] = field(repr=False)
    unanswered: Sequence[Key] = field(repr=False)


@dataclass(frozen=True)
class _Answer:
    """What a batch endpoint says of a request."""

    key: Key
    status: int
    body: object


def import_answers(
    run: Run, suite: Suite, path: Path, *, progress: Callable[[int], object] = bool
) -> Imported:
    """Add the completions in a file of answers to the run that `write_requests` began.

    A completion that is there stays; the first reply to a request counts.

    Args:
        run: the run.
        suite: the suite of the run.
        path: the file of answers.
        progress: called with the number of answers that are read, each time that it has grown.

    Raises:
        UserError: the run is of another kind, or a line is no answer to a request of it. Nothing is added.
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
            for number, answer in enumerate(_answers(path, ids), 1):
                found.add(answer)
                progress(number)
            found.keep_refused()
        new = [found.lines[key] for key in expected if key in found.lines]
        missing = [key for key in expected if key not in there and key not in found.lines]
        if new:
            _add(run, about, new, usage, is_whole=not missing)
    failed = {key: found.failed[key] for key in missing if key in found.failed}
    return Imported(len(new), len(expected), failed, [key for key in missing if key not in failed])


BatchLine: TypeAlias = tuple[
    bytes, Mapping[str, Any]
]  # a row of completions.jsonl, and the tokens that it took


def _add(
    run: Run, about: dict[str, Any], lines: list[BatchLine], usage: Counter[str], *, is_whole: bool
) -> None:
    """Add rows to a run, and to its run.json the tokens."""
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
    """The replies in answers, as lines of completions.jsonl."""

    model: BatchModel
    plan: GenerationPlan
    there: set[Key]  # completions that the run has
    lines: dict[Key, BatchLine] = field(default_factory=dict)
    failed: dict[Key, str] = field(default_factory=dict)
    refused: dict[Key, ModelError] = field(default_factory=dict)

    def add(self, answer: _Answer) -> None:
        """Add an answer, unless its request has a reply."""
        key = answer.key
        if key in self.there or key in self.lines:
            return
        try:
            prompt = self.plan.prompt(key)
            self._keep(
                key,
                self.model.reply(
                    prompt, number=self.plan.sample(key), status=answer.status, body=answer.body
                ),
            )
        except ModelError as error:
            self.failed[key] = error.sentence
            if error.is_refusal:
                self.refused[key] = error

    def keep_refused(self) -> None:
        """Keep what the endpoint refused for good, if it took another request of the run."""
        if self.there or self.lines:
            for key, error in self.refused.items():
                if key not in self.lines:
                    self._keep(key, reply_of_refusal(error))

    def _keep(self, key: Key, reply: Reply) -> None:
        row = reply_row(key, self.plan.instruction(key), self.model.name, reply)
        line = to_line(row)
        if len(line) > MAX_ROW:
            raise ModelError(f"the reply is too long to keep: {len(line):,} bytes", may_pass=False)
        self.lines[key] = line, row["usage"]
        self.failed.pop(key, None)


def _expect_begun(run: Run, suite: Suite) -> dict[str, Any]:
    """The run.json of a run that `write_requests` began by a suite."""
    if not run.about.is_file():
        begin = "name the run of `roboeval generate --requests`, which keeps them"
        raise UserError(f"is no run; these are answers to requests of a run; {begin}", file=run.path)
    about = load_head(run.about)
    if not isinstance(about.get("settings"), dict) or not batches(about):
        raise UserError("holds imported completions, which answers cannot be added to", file=run.path)
    if about.get("suite") != suite.name:
        raise UserError(f'is of the suite "{about.get("suite")}"; name it with --suite', file=run.path)
    return about


def _plan(suite: Suite, batch: Mapping[str, Any]) -> GenerationPlan:
    tasks = batch.get("tasks")
    return GenerationPlan(suite, None if tasks is None else frozenset(tasks), batch["num_completions"])


def _answers(path: Path, ids: Mapping[str, Key]) -> Iterator[_Answer]:
    """The answers in a file; raises UserError if a line is none, or one to another request."""
    for number, line in read_lines(path, limit=LONGEST_ANSWER):
        if not line.strip():
            continue
        try:
            yield _answer(line, ids)
        except UserError as error:
            raise UserError(error.sentence, file=path, line=number) from None


def _answer(line: bytes, ids: Mapping[str, Key]) -> _Answer:
    row = parse_row(line)
    if row is None:
        raise UserError("this line is not JSON; perhaps the file is incomplete")
    name = row.get("custom_id")
    if "response" not in row and "error" not in row:
        what = "a request" if "method" in row else "no answer of a batch endpoint"
        raise UserError(f"this line is {what}; name the file of answers")
    if not isinstance(name, str) or name not in ids:
        known = isinstance(name, str) and ID.fullmatch(name)
        whose = "of another run, or of other settings" if known else "that no run has"
        raise UserError(f"this line answers a request {whose}: {name!r}")
    response, error = row.get("response"), row.get("error")
    if not isinstance(response, dict):
        return _Answer(ids[name], 200, error)
    status, body = response.get("status_code"), response.get("body")
    return _Answer(ids[name], status if isinstance(status, int) else 200, error if body is None else body)
