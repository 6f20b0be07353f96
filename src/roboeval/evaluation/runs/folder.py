"""A run: a folder with a model's completions and their evaluations, which survives every interruption."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from codebotler import __version__
from codebotler.core.errors import UserError
from codebotler.core.files import open_replacement, read_text, sync_folder, to_line, to_text, write_whole
from roboeval.evaluation.runs.completions import COMPLETIONS, Completion, read_completions
from roboeval.suites.load import ABLATED, Suite

RULES = "-rules-"  # between a suite and house rules, in the name of an evaluation


@dataclass(frozen=True)
class Run:
    """The folder of a run."""

    path: Path

    @property
    def completions(self) -> Path:
        """The programs, a row each."""
        return self.path / COMPLETIONS

    @property
    def about(self) -> Path:
        """Who wrote the completions, and how they were asked for."""
        return self.path / "run.json"

    @property
    def in_flight(self) -> Path:
        """Requests that are under way."""
        return self.path / "inflight.jsonl"

    def rows(self, key: str) -> Path:
        """The rows of an evaluation, by its `evaluation_key`."""
        return self.path / "evaluations" / f"{key}.jsonl"

    def head(self, key: str) -> Path:
        """By what the rows of an evaluation were judged."""
        return self.path / "evaluations" / f"{key}.json"

    def checks(self, key: str) -> Path:
        """The problems of its programs; `key` is that of their evaluation."""
        return self.path / "checks" / f"{key}.jsonl"

    def checks_head(self, key: str) -> Path:
        """How they were checked."""
        return self.path / "checks" / f"{key}.json"

    def judged_by(self) -> list[str]:
        """The names of the suites by which it was judged, sorted."""
        keys = (path.stem for path in self.rows("").parent.glob("*.jsonl"))
        return sorted({key.removesuffix(ABLATED) for key in keys})

    def houses(self, suite: str) -> list[str]:
        """The names of the house rules by which a suite has judged it, but for the suite's own, sorted."""
        before = f"{suite}{RULES}"
        return [key.removeprefix(before) for key in self.judged_by() if key.startswith(before)]

    def read(self, suite: Suite | None = None) -> Iterator[Completion]:
        """Its completions; with a suite, all must be of tasks and prompts of it."""
        return read_completions(self.completions, suite, growing=True)

    @contextlib.contextmanager
    def writing(self) -> Iterator[None]:
        """Keep other processes from writing this run; raises UserError if one is writing it."""
        self._expect_no_others()
        made = [folder for folder in (self.path, *self.path.parents) if not folder.exists()]
        lock = self.path / ".lock"
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except FileExistsError:
            raise UserError("is a file, but a run is a folder; name another", file=self.path) from None
        except OSError as error:
            raise UserError(f"cannot be written ({error.strerror})", file=self.path) from None
        if not _locked(descriptor):
            os.close(descriptor)
            raise UserError("another process is writing this run; wait until it has finished", file=self.path)
        try:
            for folder in made:
                sync_folder(folder.parent)
            yield
        except BaseException:
            if made and list(self.path.iterdir()) == [lock]:
                lock.unlink()
                with contextlib.suppress(OSError):
                    for folder in made:
                        folder.rmdir()
            raise
        finally:
            os.close(descriptor)

    @property
    def is_being_written(self) -> bool:
        """Whether a process writes it. Our hold lasts a moment, for which a writer has patience."""
        flags = os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
        try:
            descriptor = os.open(self.path / ".lock", flags)
        except OSError:
            return False
        try:
            fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return True
        finally:
            os.close(descriptor)
        return False

    def _expect_no_others(self) -> None:
        """Refuse a folder that holds something, and is no run."""
        if self.completions.exists() or self.about.exists() or not self.path.is_dir():
            return
        others = sorted(one.name for one in self.path.iterdir() if not one.name.startswith("."))
        if others:
            raise UserError(
                f'is not a run but contains other files such as "{others[0]}"; name a new folder',
                file=self.path,
            )

    def keep(self, completions: Sequence[Completion]) -> None:
        """Copy completions into this run; raises UserError if it holds others. An error changes nothing."""
        models = {completion.model for completion in completions}
        lines = (to_line(completion.row) for completion in completions)
        with self.writing():
            if self.completions.exists():
                with self.completions.open("rb") as file:
                    same = all(file.read(len(line)) == line for line in lines)
                    if not same or file.read(1):
                        other = (
                            "this run holds other completions; name another folder, or copy the new ones to "
                            f"{self.completions} and run `roboeval evaluate {self.path} --redo`"
                        )
                        raise UserError(other, file=self.path)
                return
            about = {"model": models.pop() if len(models) == 1 else None, "codebotler": __version__}
            write_whole(self.about, to_text(about))
            try:
                with open_replacement(self.completions) as file:
                    file.writelines(lines)
            except BaseException:
                self.about.unlink()
                raise


PATIENCE = 20  # times that a lock is tried
PAUSE = 0.05  # seconds between two


def _locked(descriptor: int) -> bool:
    """Lock a file; children of a process that was killed may hold it for a moment longer."""
    for _ in range(PATIENCE):
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            time.sleep(PAUSE)
        else:
            return True
    return False


def load_head(path: Path) -> dict[str, Any]:
    """Read a KEY.json or run.json."""
    text = read_text(path)
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        data = None
    if not isinstance(data, dict):
        raise UserError("is not a JSON object", file=path)
    return data


def selected_tasks(head: Mapping[str, Any]) -> frozenset[str] | None:
    """The tasks that a KEY.json names; None for all."""
    tasks = head.get("tasks")
    return None if tasks is None else frozenset(tasks)


def about_of(run: Run) -> dict[str, Any]:
    """The content of a run's run.json; nothing if there is none."""
    return load_head(run.about) if run.about.exists() else {}


def evaluation_key(suite: Suite, *, ablated: bool) -> str:
    """The name of an evaluation's files."""
    named = suite.house is not None and suite.house.name
    rules = f"{RULES}{named}" if named else ""
    return suite.name + rules + ABLATED * ablated


def tasks_to_judge(
    suite: Suite, names: str | None, *, ablated: bool
) -> tuple[frozenset[str] | None, tuple[str, ...]]:
    """The tasks of a list with commas, None for all, and those left out as they have no ablation."""
    wanted = [*suite.tasks] if names is None else [suite.task(name.strip()).name for name in names.split(",")]
    if not ablated:
        return (None if names is None else frozenset(wanted)), ()
    left = tuple(name for name in wanted if suite.tasks[name].ablation is None)
    kept = frozenset(wanted) - frozenset(left)
    if not kept:
        raise UserError(f"none of {', '.join(wanted)} has an ablation")
    return kept, left


def as_judged(run: Run, suite: Suite, *, ablated: bool) -> Suite:
    """The suite with the worlds in which a run was judged, if other ones were drawn then."""
    path = run.head(evaluation_key(suite, ablated=ablated))
    drawn = suite.worlds, suite.seed
    if suite.worlds is None or not path.is_file():
        return suite
    match load_head(path):
        case {"worlds": int(worlds), "seed": int(seed)} if worlds > 0 and (worlds, seed) != drawn:
            return suite.with_worlds(worlds, seed).with_house_rules(suite.house)
    return suite


def evaluation_of(
    path: Path, suite: Suite, *, ablated: bool, again: str = "roboeval evaluate"
) -> tuple[Run, str, Suite]:
    """A run, the name of its evaluation by a suite, and the suite with the worlds that it had then.

    Raises UserError if the suite has not judged it; the command `again` does.
    """
    run = Run(path)
    suite = as_judged(run, suite, ablated=ablated)
    key = evaluation_key(suite, ablated=ablated)
    if not run.completions.is_file():
        raise UserError("is not a run: it has no completions.jsonl", file=path)
    if not run.rows(key).is_file():
        others, houses = run.judged_by(), run.houses(suite.name)
        if houses and suite.name not in others:
            named = ", ".join(houses)
            mend = f"name their file with --rules, or run `{again}`"
            raise UserError(f"was judged with house rules only ({named}); {mend}", file=path)
        if not others or suite.name in others:
            raise UserError(f"has not been judged; run `{again}`", file=path)
        judges, ours = " and ".join(f'"{name}"' for name in others), f'"{suite.name}"'
        raise UserError(f"was judged by the suite {judges}, not by {ours}; name it with --suite", file=path)
    return run, key, suite
