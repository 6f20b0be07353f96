"""Generates the completions of a run, and continues a run that was interrupted."""

from __future__ import annotations

import asyncio
import contextlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any

from codebotler.core.files import MAX_ROW, Appender, to_line, to_text, write_whole
from codebotler.models.base import BudgetSpentError, Model, ModelError, Reply, Usage, make_reply
from codebotler.models.rate_limit import RateLimited
from codebotler.prompts import Prompt
from roboeval.evaluation.generating.requests import GenerationPlan, RequestLog, begin_batch
from roboeval.evaluation.runs.completions import CompletionKey, how_many
from roboeval.evaluation.runs.endings import SERVER_REJECTED
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.evaluation.runs.turns import TurnLog

FAILURES_IN_A_ROW = 3  # stop after this many, or the number of concurrent requests if larger


@dataclass(frozen=True)
class Pace:
    """Limits on concurrent requests, requests per minute, and total tokens. None means no limit."""

    concurrency: int = 8
    requests_per_minute: float | None = None
    token_budget: int | None = None


@dataclass
class GenerationProgress:
    """Counts the completions that a run should have and those it has, their tokens, and failed requests."""

    total: int
    found: int  # completions present at the start
    interrupted: int  # requests pending at the last interruption, which may be billed twice
    usage: Counter[str] = field(default_factory=Counter)  # token counts of the new completions
    failures: dict[CompletionKey, ModelError] = field(default_factory=dict)  # of requests without a row
    stopped: str | None = None  # why generation stopped early

    def __post_init__(self) -> None:
        self.done = self.found

    @property
    def missing(self) -> str | None:
        """A sentence such as "3 completions are missing: timed out", or None if nothing went wrong."""
        left = self.total - self.done
        failed = (error.sentence for error in self.failures.values())
        reason = self.stopped or next(failed, "they were not requested")
        return f"{how_many(left)} {'is' if left == 1 else 'are'} missing: {reason}" if left else self.stopped


def generate_run(
    run: RunFolder,
    plan: GenerationPlan,
    model: Model,
    pace: Pace,
    *,
    on_progress: Callable[[GenerationProgress], None] = lambda _: None,
) -> GenerationProgress:
    """Request the missing completions of a run, save each as it arrives, and close the model.

    Returns the final progress, which names the requests that failed. Raises UserError if the run has other
    settings, or ModelError if requests failed and the run is still empty.
    """
    with run.writing():
        with contextlib.closing(Appender(run.completions)) as file:  # drops a torn last line
            metadata, done, todo = begin_batch(run, plan, model.name, model.settings)
            log = RequestLog(run.in_flight, done)
            metadata["possibly_paid_twice"] += log.interrupted
            write_whole(run.about, to_text(metadata))
            for completion in plan.copied_completions():
                if completion.key not in done:
                    file.append(to_line(completion.row))
            total = len(plan.keys())
            progress = GenerationProgress(total, total - len(todo), log.interrupted)
            turns = TurnLog(run.turns, done) if plan.has_turns else None
            with log, contextlib.closing(turns) if turns else contextlib.nullcontext():
                on_progress(progress)
                generation = _Generation(plan, model, pace, file, log, turns, progress, on_progress)
                asyncio.run(generation.generate(todo))
        is_empty = not run.completions.stat().st_size and not run.turns.exists()
        if generation.error is not None and is_empty:
            run.completions.unlink()
            run.about.unlink()
            raise generation.error
    return progress


def reply_of_refusal(error: ModelError) -> Reply:
    """Return a reply without a program, which records that the server refused a request for its content."""
    return make_reply(error.sentence, Usage(), None, None, known_kind="refusal", has_answer=False)


@dataclass
class _Generation:
    """Requests completions concurrently and saves each as it arrives."""

    plan: GenerationPlan
    model: Model
    pace: Pace
    file: Appender
    log: RequestLog
    turns: TurnLog | None  # None if each completion is one reply
    progress: GenerationProgress
    on_progress: Callable[[GenerationProgress], None]
    error: ModelError | None = None
    _failures_in_a_row: int = 0
    _budget: int | None = None  # tokens used when the budget ran out

    def __post_init__(self) -> None:
        self._paced = RateLimited(self.model, **asdict(self.pace))

    async def generate(self, keys: list[CompletionKey]) -> None:
        waiting = iter(keys)
        try:
            async with asyncio.TaskGroup() as group:
                for _ in range(min(self.pace.concurrency, len(keys))):
                    group.create_task(self._request_each(waiting))
            if self.progress.stopped is None and self.progress.done:
                await self._keep_refused()
            if self._budget is not None:  # pending requests have used more tokens in the meantime
                self.progress.stopped = BudgetSpentError(self._budget, self._paced.tokens_used).sentence
        except BaseExceptionGroup as errors:
            raise errors.exceptions[0] from None
        finally:
            await self.model.close()

    async def _request_each(self, waiting: Iterator[CompletionKey]) -> None:
        for key in waiting:
            if self.progress.stopped is None:
                await self._request(key)

    async def _request(self, key: CompletionKey) -> None:
        try:
            row = await self.plan.complete(key, self.model.name, partial(self._ask, key), self._earlier(key))
            await self._keep(key, row)
        except BudgetSpentError as error:
            self._budget, self.progress.stopped = error.budget, error.sentence
        except ModelError as error:
            self.log.ended(key)
            self.error = self.progress.failures[key] = error
            self._count_failure()

    def _count_failure(self) -> None:
        self._failures_in_a_row += 1
        if self.error and self._failures_in_a_row >= max(FAILURES_IN_A_ROW, self.pace.concurrency):
            self.progress.stopped = self.error.sentence

    async def _ask(self, key: CompletionKey, prompt: Prompt) -> Reply:
        logged = partial(self._logged, key)
        try:
            reply = await self._paced.reply(prompt, number=self.plan.sample(key), around=logged)
        except ModelError as error:
            self.error = error
            raise
        if self.turns is not None:
            await self.turns.keep(key, reply)
            self.log.ended(key)
        return reply

    @contextlib.contextmanager
    def _logged(self, key: CompletionKey) -> Iterator[None]:
        """Log a request, including each retry, before it is sent."""
        self.log.sent(key)
        try:
            yield
        except ModelError:
            self.log.ended(key)
            raise

    def _earlier(self, key: CompletionKey) -> list[Reply]:
        return [] if self.turns is None else self.turns.replies(key)

    async def _keep(self, key: CompletionKey, row: dict[str, Any]) -> None:
        line = to_line(row)
        if (size := len(line)) > MAX_ROW:
            raise ModelError(f"the reply has {size:,} bytes; the limit is {MAX_ROW:,}", is_temporary=True)
        self.file.append(line)
        if self.turns is None:
            self.log.kept(key)
        else:
            self.turns.forget(key)
        try:
            await asyncio.to_thread(self.file.sync)
        finally:  # also after an interrupt, because closing the file syncs it to disk
            for name in ("input_tokens", "output_tokens"):
                self.progress.usage[name] += row["usage"][name] or 0
            self.progress.done += 1
        if row.get("ending") == SERVER_REJECTED:
            self._count_failure()
        else:
            self._failures_in_a_row = 0
        self.on_progress(self.progress)

    async def _keep_refused(self) -> None:
        # The server accepted other requests, so these were refused because of their content.
        refused = {key: error for key, error in self.progress.failures.items() if error.is_refusal}
        for key, error in refused.items():
            replies = [*self._earlier(key), reply_of_refusal(error)]
            row = await self.plan.complete(key, self.model.name, partial(self._ask, key), replies)
            self.file.append(to_line(row))
            del self.progress.failures[key]
            self.progress.done += 1
