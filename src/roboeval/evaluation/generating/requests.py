"""Plans the requests of a run and of further rounds, describes them in run.json, and logs pending ones."""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Awaitable, Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, ClassVar, Self, TypeAlias

from codebotler import __version__
from codebotler.core.errors import UserError
from codebotler.core.files import Appender, read_rows, to_line, write_whole
from codebotler.core.text.words import brief
from codebotler.models.base import Reply
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt, prompt_for, template_hash
from roboeval.evaluation.runs.completions import Completion, CompletionKey, name_of, read_completions, row_for
from roboeval.evaluation.runs.folder import RunFolder, load_json_object
from roboeval.suites.load import Suite

Ask: TypeAlias = Callable[[Prompt], Awaitable[Reply]]
"""A function that sends a prompt to the model and returns the reply."""

WITHOUT_EFFECT = ("timeout", "base_url")  # settings that do not change a model's replies
OPTIONAL_SETTINGS = ("reasoning_effort", "extra_body")  # left out of run.json if unset


SAMPLE_STRIDE = 1_000_000  # offset of sample numbers between rounds, so that all seeds differ


@dataclass(frozen=True)
class GenerationPlan:
    """The completions that a run should have: `num_completions` for each prompt of `tasks` (None: all)."""

    suite: Suite
    tasks: frozenset[str] | None = None
    num_completions: int = 50

    has_turns: ClassVar[bool] = False  # whether a completion takes several replies

    def keys(self) -> list[CompletionKey]:
        """Return the keys of all completions: first index 0 of every prompt, then index 1, and so on."""
        tasks = [task for name, task in self.suite.tasks.items() if self.tasks is None or name in self.tasks]
        prompts = [(task.name, prompt) for task in tasks for prompt in range(len(task.prompts))]
        return [(*prompt, index) for index in range(self.num_completions) for prompt in prompts]

    def instruction(self, key: CompletionKey) -> str:
        """Return the instruction for which a completion is requested."""
        return self.suite.tasks[key[0]].prompts[key[1]]

    def prompt(self, key: CompletionKey) -> Prompt:
        """Return the prompt that is sent to request a completion."""
        rules, skills = self.suite.house_sentences, self.suite.skills
        return prompt_for(self.instruction(key), rules=rules, skills=skills)

    def sample(self, key: CompletionKey) -> int:
        """Return a completion's index within its prompt, to vary the model's random seed."""
        return key[2]

    def copied_completions(self) -> Iterable[Completion]:
        """Return the completions to copy instead of requesting them. Only a `RoundPlan` has any."""
        return ()

    def describe(self) -> dict[str, Any]:
        """Return the entries of run.json that depend on the plan, such as the hash of the prompt template."""
        return {"template": template_hash(self.suite.skills)}

    async def complete(
        self, key: CompletionKey, model: str, ask: Ask, earlier: Sequence[Reply] = ()
    ) -> dict[str, Any]:
        """Return the row of a completion. Ask the model for a reply, unless `earlier` contains one."""
        reply = earlier[-1] if earlier else await ask(self.prompt(key))
        return row_for(key, self.instruction(key), model, reply.data())

    def completed(self, run: RunFolder) -> Iterator[Completion]:
        """Read the existing completions. Raise UserError if an instruction differs from the suite's."""
        if not run.completions.is_file() or not run.completions.stat().st_size:
            return
        for completion in read_completions(run.completions, self.suite):
            if completion.instruction != self.instruction(completion.key):
                why = "was generated from a different instruction than the suite's current one"
                sentence = f"{name_of(completion.key)} {why}; name another folder"
                raise UserError(sentence, file=run.completions)
            yield completion


@dataclass(frozen=True, kw_only=True)
class RoundPlan(GenerationPlan):
    """Plans a later round of requests (paper, section VI). Each round is a run in its own folder.

    A round copies the programs that the program check accepts, and requests new ones for the others.

    Args:
        number: the round, from 1; round 0 wrote the first programs.
        repairs: whether requests contain the rejected program and its problems, instead of the usual prompt.
        earlier: the completions of the previous round.
        problems: the problems of each rejected program, by completion key.
    """

    number: int
    repairs: bool
    earlier: Mapping[CompletionKey, Completion] = field(repr=False)
    problems: Mapping[CompletionKey, Sequence[str]] = field(repr=False)

    def prompt(self, key: CompletionKey) -> Prompt:
        """Return the prompt for a completion. A repair includes the rejected program and its problems."""
        first, program = super().prompt(key), self.earlier[key].program
        return first.after(program, self.problems[key]) if self.repairs and program.strip() else first

    def sample(self, key: CompletionKey) -> int:
        """Return a number that differs between a prompt's completions and rounds, to vary the random seed."""
        return key[2] + self.number * SAMPLE_STRIDE

    def copied_completions(self) -> Iterator[Completion]:
        """Return the completions to copy: those of the previous round that the program check accepted."""
        return (one for key, one in self.earlier.items() if key not in self.problems)

    def folder(self, run: RunFolder) -> RunFolder:
        """Return this round's folder, such as `retry-2` or `repair-1`, in `run`, the folder of round 0."""
        return RunFolder(run.path / f"{'repair' if self.repairs else 'retry'}-{self.number}")


def begin_batch(
    run: RunFolder, plan: GenerationPlan, model: str, settings: SamplingSettings
) -> tuple[dict[str, Any], set[CompletionKey], list[CompletionKey]]:
    """Plan requests. Return the new content of run.json, the keys that exist, and the keys to request.

    Raises UserError if existing completions have other settings.
    """
    about, done = _run_metadata(run, plan, model, settings), {one.key for one in plan.completed(run)}
    there = done | {one.key for one in plan.copied_completions()}
    todo = [key for key in plan.keys() if key not in there]  # noqa: SIM118 - a plan is no mapping
    if todo:
        about["batches"] = _with_batch(about["batches"], plan, settings)
    return about, done, todo


def _run_metadata(
    run: RunFolder, plan: GenerationPlan, model: str, settings: SamplingSettings
) -> dict[str, Any]:
    fixed = {"model": model, "settings": _recorded(settings), **plan.describe(), "suite": plan.suite.name}
    earlier: dict[str, Any] = {}
    if run.about.exists():
        earlier = load_json_object(run.about)
        if not isinstance(earlier.get("settings"), dict):
            raise UserError("the run has imported completions; name another folder", file=run.path)
        _expect_same(earlier, fixed, run.about)
    elif run.completions.exists() and run.completions.stat().st_size:
        why = "this file is missing, so the settings of the completions are unknown"
        raise UserError(f"{why}; name another folder", file=run.about)
    paid_twice = earlier.get("possibly_paid_twice", 0)
    return {**fixed, "batches": batches(earlier), "possibly_paid_twice": paid_twice}


def _recorded(settings: SamplingSettings) -> dict[str, Any]:
    return {
        name: value
        for name, value in asdict(settings).items()
        if name not in WITHOUT_EFFECT and (value is not None or name not in OPTIONAL_SETTINGS)
    }


def _with_batch(
    earlier: list[dict[str, Any]], plan: GenerationPlan, settings: SamplingSettings
) -> list[dict[str, Any]]:
    """Append the batch of a plan, unless the last batch is the same one."""
    batch = {
        "tasks": None if plan.tasks is None else sorted(plan.tasks),
        "num_completions": plan.num_completions,
        "settings": asdict(settings),
        "codebotler": __version__,
        "python": platform.python_version(),
    }
    if earlier and earlier[-1].items() >= batch.items():
        return earlier
    return [*earlier, {**batch, "started": timestamp()}]


def batches(metadata: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the batches of requests recorded in `metadata`, the content of run.json, in order."""
    found = metadata.get("batches")
    return [dict(one) for one in found if isinstance(one, dict)] if isinstance(found, list) else []


def requested_tasks(metadata: Mapping[str, Any]) -> frozenset[str] | None:
    """Return the tasks requested so far according to `metadata`, the content of run.json, or None for all."""
    requested: set[str] = set()
    for batch in batches(metadata):
        if not isinstance(batch.get("tasks"), list):
            return None
        requested |= {*batch["tasks"]}
    return frozenset(requested)


OPTIONAL_ENTRIES = {"mode": "program", "contract": None, "max_mission_tokens": None}
"""Entries that are left out of run.json if they have these values."""


def _expect_same(earlier: dict[str, Any], fixed: dict[str, Any], file: Path) -> None:
    before, now = (
        {**OPTIONAL_ENTRIES, **values, **values["settings"], "settings": None} for values in (earlier, fixed)
    )
    for name, value in now.items():
        if before.get(name) != value:
            what = "prompt template" if name == "template" else name.replace("_", "-")
            which = f"a different {what} ({_brief(before.get(name))}, now {_brief(value)})"
            sentence = f"the completions were generated with {which}; name another folder to start over"
            raise UserError(sentence, file=file)


def _brief(value: object) -> str:
    return brief("none" if value is None else str(value), 24)


def timestamp() -> str:
    """Return the current time in UTC, such as `2026-03-01T09:30:00+00:00`."""
    return datetime.now(UTC).isoformat(timespec="seconds")


class RequestLog:
    """Logs requests, to count those pending when a command is interrupted, which may be billed twice.

    Each request is logged before it is sent, and again if it ends without a completion. Any other request
    without a completion was pending. Each command starts a new file, and deletes it on normal exit.
    """

    def __init__(self, path: Path, done: set[CompletionKey]) -> None:
        self.path = path
        self.interrupted = len(self._read() - done)  # requests pending at the last interruption
        self.under_way: set[CompletionKey] = set()

    def __enter__(self) -> Self:
        """Start a new file, because run.json now counts the pending requests."""
        write_whole(self.path, b"")
        self._file = Appender(self.path)
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        with contextlib.suppress(OSError):  # a full disk has already been reported
            self._file.close()
        if kind is None and not self.under_way:
            self.path.unlink()

    def sent(self, key: CompletionKey) -> None:
        """Log a request before it is sent. If the disk is full, the OSError prevents the request."""
        self._file.append(to_line({"sent": key}))
        self.under_way.add(key)

    def ended(self, key: CompletionKey) -> None:
        """Log that a pending request has failed, or that its reply, a turn of a mission, has been saved."""
        if key in self.under_way:
            self.kept(key)
            self._file.append(to_line({"ended": key}))

    def kept(self, key: CompletionKey) -> None:
        """Count a request as no longer pending, because its completion has been saved."""
        self.under_way.remove(key)

    def _read(self) -> set[CompletionKey]:
        pending: set[CompletionKey] = set()
        for number, row in read_rows(self.path) if self.path.exists() else ():
            match row:
                case {"sent": [str(task), int(prompt), int(index)]}:
                    pending.add((task, prompt, index))
                case {"ended": [str(task), int(prompt), int(index)]}:
                    pending.discard((task, prompt, index))
                case _:
                    raise UserError("this request log is damaged; delete it", file=self.path, line=number)
        return pending
