"""Asks a model for the completions of a suite's prompts, going on where it was interrupted before."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from dataclasses import asdict, dataclass, field
from typing import Any

from codebotler.files import MAX_ROW, Appender, to_line, to_text, write_whole
from codebotler.models.base import BudgetSpentError, Heard, Model, ModelError, Reply, Settings, unheard
from codebotler.models.paced import Paced
from codebotler.prompts import Prompt, prompt_for
from roboeval.evaluation.completions import Key, how_many
from roboeval.evaluation.inflight import InFlight
from roboeval.evaluation.order import Order, Used, found, head, now_in_words
from roboeval.evaluation.run import Run

FAILURES_IN_A_ROW = 3  # after so many, or one for each request under way, a model is given up


@dataclass(frozen=True)
class Pace:
    """How hard a model may be pressed.

    Args:
        concurrency: how many requests are under way at the same time, at least 1.
        requests_per_minute: how many are sent in a minute at most; None for no limit.
        token_budget: after how many tokens no further request is sent; None for no limit.
    """

    concurrency: int = 8
    requests_per_minute: float | None = None
    token_budget: int | None = None


@dataclass
class Progress:
    """How far a run has come.

    Args:
        total: how many completions it shall have.
        found: how many of them it had at the start.
        twice: how many requests were under way at the last interruption, and may be paid twice.
        used: the tokens of all its completions.
        under_way: how many requests were under way when it ended; some only if it was interrupted.
        failures: what went wrong with each completion that the model failed to give, in a sentence.
        stopped: why no further request is made, in a sentence; None while there is no reason.
    """

    total: int
    found: int
    twice: int
    used: Used
    under_way: int = 0
    failures: dict[Key, str] = field(default_factory=dict)
    stopped: str | None = None

    def __post_init__(self) -> None:
        self.done = self.found
        self._started = time.monotonic()

    @property
    def rate(self) -> float:
        """How many completions come in a second."""
        return (self.done - self.found) / max(time.monotonic() - self._started, 0.001)

    @property
    def missing(self) -> str | None:
        """What is missing at the end, and why, in a sentence; None if nothing is."""
        left = self.total - self.done
        reason = self.stopped or next(iter(self.failures.values()), "they were not asked for")
        return f"{how_many(left)} {'is' if left == 1 else 'are'} missing: {reason}" if left else None


def silent(_progress: Progress) -> None:
    """Tell nobody."""


def generate_run(
    run: Run,
    order: Order,
    model: Model,
    settings: Settings,
    pace: Pace,
    *,
    begun: Callable[[Progress], None] = silent,
    told: Callable[[Progress], None] = silent,
) -> Progress:
    """Ask for the completions that a run still lacks; each is on the disk before it counts.

    Args:
        run: whose folder gets them.
        order: which it shall have.
        model: who is asked; it is closed at the end.
        settings: how the model was opened.
        pace: how hard it may be pressed.
        begun: told once, before the first request.
        told: told whenever a completion has been added.

    Raises:
        BadInput: the run is being written, or holds completions that were asked for otherwise.
        ModelError: there was no reply at all, so that there is nothing to keep.
        OSError: the disk is full; what was written before stays.
    """
    with run.writing():
        about = head(run, order, model.name, settings)
        with contextlib.closing(Appender(run.completions)) as file, InFlight(run.in_flight) as in_flight:
            done, used = found(run, order)
            todo = [key for key in order.wanted() if key not in done]
            twice = in_flight.read(done, about["possibly_paid_twice"])
            about |= {"possibly_paid_twice": in_flight.lost, "ended": None if todo else about["ended"]}
            _write(run, about, used)
            in_flight.clear()
            progress = Progress(len(order.wanted()), len(order.wanted()) - len(todo), twice, used)
            begun(progress)
            asking = _Asking(order, model, pace, file=file, in_flight=in_flight, progress=progress, told=told)
            try:
                asyncio.run(asking.ask_for(todo))
            finally:
                progress.under_way = len(in_flight)
            if progress.missing is None:
                about["ended"] = about["ended"] or now_in_words()
            _write(run, about, used)
        if asking.error is not None and not run.completions.stat().st_size:
            for path in (run.completions, run.about, run.in_flight):
                path.unlink(missing_ok=True)
            raise asking.error
    return progress


def _write(run: Run, about: dict[str, Any], used: Used) -> None:
    write_whole(run.about, to_text(about | {"usage": asdict(used)}))


_KEY: ContextVar[Key] = ContextVar("_KEY")


@dataclass(frozen=True)
class _Noted:
    """A model each of whose requests is noted just before it is sent, every try of it."""

    model: Model
    in_flight: InFlight

    @property
    def name(self) -> str:
        return self.model.name

    async def reply(self, prompt: Prompt, *, number: int, heard: Heard = unheard) -> Reply:
        self.in_flight.sent(_KEY.get())
        try:
            return await self.model.reply(prompt, number=number, heard=heard)
        except ModelError:
            self.in_flight.failed(_KEY.get())
            raise

    async def close(self) -> None:
        await self.model.close()


class _Asking:
    """Asks for completions, several at the same time, and keeps each; `error` is the last of the model's.

    A line is in the file as soon as its reply is there. Before it counts, the file must be on the disk: those
    that wait for this at the same time wait for it once.
    """

    def __init__(
        self,
        order: Order,
        model: Model,
        pace: Pace,
        *,
        file: Appender,
        in_flight: InFlight,
        progress: Progress,
        told: Callable[[Progress], None],
    ) -> None:
        self._order, self._pace, self._file, self._in_flight = order, pace, file, in_flight
        self._progress, self._told = progress, told
        self._model = Paced(
            _Noted(model, in_flight),
            concurrency=pace.concurrency,
            requests_per_minute=pace.requests_per_minute,
            token_budget=pace.token_budget,
        )
        self._prompts: dict[str, Prompt] = {}
        self.error: ModelError | None = None
        self._failed_in_a_row = 0
        self._written = self._synced = 0
        self._syncing = asyncio.Lock()

    async def ask_for(self, keys: list[Key]) -> None:
        """Ask for all of them, or until there is a reason to stop.

        Raises:
            OSError: a reply cannot be kept.
        """
        waiting = iter(keys)
        try:
            async with asyncio.TaskGroup() as group:
                for _ in range(min(self._pace.concurrency, len(keys))):
                    group.create_task(self._ask_in_turn(waiting))
        except BaseExceptionGroup as errors:
            raise errors.exceptions[0] from None
        finally:
            await self._model.close()

    async def _ask_in_turn(self, waiting: Iterator[Key]) -> None:
        for key in waiting:
            if self._progress.stopped is None:
                await self._ask(key)

    async def _ask(self, key: Key) -> None:
        _KEY.set(key)
        try:
            reply = await self._model.reply(self._prompt(self._order.instruction(key)), number=key[2])
            await self._keep(key, reply)
        except BudgetSpentError as error:
            self._progress.stopped = error.sentence
        except ModelError as error:
            self._in_flight.failed(key)
            self._failed(key, error)

    def _prompt(self, instruction: str) -> Prompt:
        if instruction not in self._prompts:
            self._prompts[instruction] = prompt_for(instruction)
        return self._prompts[instruction]

    def _failed(self, key: Key, error: ModelError) -> None:
        self.error = error
        self._progress.failures[key] = error.sentence
        self._failed_in_a_row += 1
        if self._failed_in_a_row >= max(FAILURES_IN_A_ROW, self._pace.concurrency):
            self._progress.stopped = error.sentence

    async def _keep(self, key: Key, reply: Reply) -> None:
        row = {
            **dict(zip(("task", "prompt", "index"), key, strict=True)),
            "instruction": self._order.instruction(key),
            "model": self._model.name,
            "program": reply.program,
            "raw_reply": reply.text,
            "usage": asdict(reply.usage),
            "latency_s": round(reply.latency_s, 3),
            "finish_reason": reply.finish_reason,
        }
        line = to_line(row)
        if len(line) > MAX_ROW:
            raise ModelError(f"the reply is too long to be kept: {len(line):,} bytes", may_pass=True)
        self._file.append(line)
        self._in_flight.kept(key)
        try:
            await self._sync()
        except asyncio.CancelledError:  # it is in the file, which is brought to the disk as it is closed
            self._count(reply)
            raise
        self._failed_in_a_row = 0
        self._count(reply)
        self._told(self._progress)

    def _count(self, reply: Reply) -> None:
        self._progress.used.add(asdict(reply.usage))
        self._progress.done += 1

    async def _sync(self) -> None:
        self._written += 1
        mine = self._written
        async with self._syncing:
            if self._synced < mine:
                written = self._written
                await asyncio.to_thread(self._file.sync)
                self._synced = written
