"""Manages the folder of a run, so that completions and evaluations survive every interruption."""

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

RULES_INFIX = "-rules-"  # separates the suite and the house rules in an evaluation's name


@dataclass(frozen=True)
class RunFolder:
    """The folder of a run, with the paths of its files."""

    path: Path

    @property
    def completions(self) -> Path:
        """Return the path of completions.jsonl."""
        return self.path / COMPLETIONS

    @property
    def about(self) -> Path:
        """Return the path of run.json, which describes the model and its prompts."""
        return self.path / "run.json"

    @property
    def in_flight(self) -> Path:
        """Return the path of inflight.jsonl, the log of pending requests."""
        return self.path / "inflight.jsonl"

    @property
    def turns(self) -> Path:
        """Return the path of turns.jsonl, the log of an agent's replies."""
        return self.path / "turns.jsonl"

    def rows(self, key: str) -> Path:
        """Return the path of KEY.jsonl, the rows of an evaluation. `key` is its `evaluation_key`."""
        return self.path / "evaluations" / f"{key}.jsonl"

    def manifest(self, key: str) -> Path:
        """Return the path of KEY.json, which records the suite and tool of an evaluation."""
        return self.path / "evaluations" / f"{key}.json"

    def checks(self, key: str) -> Path:
        """Return the path of the file that lists the problems found by the program check in each program."""
        return self.path / "checks" / f"{key}.jsonl"

    def questions(self, key: str) -> Path:
        """Return the folder of the results of `roboeval clarify` for the evaluation `key`, such as `plus`."""
        return self.path / "clarify" / key

    def judged_by(self) -> list[str]:
        """Return the sorted names of the evaluations, such as `plus`, without the suffix of an ablation."""
        keys = (path.stem for path in self.rows("").parent.glob("*.jsonl"))
        return sorted({key.removesuffix(ABLATED) for key in keys})

    def read(self, suite: Suite | None = None) -> Iterator[Completion]:
        """Read the completions of the run. Raise UserError if one does not belong to the given suite."""
        return read_completions(self.completions, suite, growing=True)

    @contextlib.contextmanager
    def writing(self) -> Iterator[None]:
        """Lock this run so that no other process can write to it. Raise UserError if one already does."""
        self._expect_no_others()
        made = [folder for folder in (self.path, *self.path.parents) if not folder.exists()]
        lock = self.path / ".lock"
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except FileExistsError:
            raise UserError("this is a file, not a run folder; choose another path", file=self.path) from None
        except OSError as error:
            raise UserError(f"the run cannot be written ({error.strerror})", file=self.path) from None
        if not _locked(descriptor):
            os.close(descriptor)
            raise UserError("another process is writing to this run; wait until it is done", file=self.path)
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
        """Whether a process is writing to this run. The check locks the run briefly, so a writer may wait."""
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
        """Raise UserError if the folder contains files but is not a run."""
        if self.completions.exists() or self.about.exists() or not self.path.is_dir():
            return
        others = sorted(one.name for one in self.path.iterdir() if not one.name.startswith("."))
        if others:
            what = f'contains other files such as "{others[0]}"'
            raise UserError(f"this is not a run, but {what}; name a new folder", file=self.path)

    def import_completions(self, completions: Sequence[Completion]) -> None:
        """Copy completions into this run. Raise UserError, and change nothing, if it has different ones."""
        models = {completion.model for completion in completions}
        with self.writing():
            if self.completions.exists():
                if [*self.read()] != [*completions]:
                    again = f"copy them to {self.completions} and run `roboeval evaluate {self.path} --redo`"
                    other = "this run holds different completions; name another folder for the new ones, or"
                    raise UserError(f"{other} {again}", file=self.path)
                return
            about = {"model": models.pop() if len(models) == 1 else None, "codebotler": __version__}
            write_whole(self.about, to_text(about))
            try:
                with open_replacement(self.completions) as file:
                    file.writelines(to_line(completion.row) for completion in completions)
            except BaseException:
                self.about.unlink()
                raise


LOCK_ATTEMPTS = 20
LOCK_PAUSE_SECONDS = 0.05


def _locked(descriptor: int) -> bool:
    """Try to lock a file, for a short time because children of a killed process may still hold the lock."""
    for _ in range(LOCK_ATTEMPTS):
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            time.sleep(LOCK_PAUSE_SECONDS)
        else:
            return True
    return False


def load_json_object(path: Path) -> dict[str, Any]:
    """Read a JSON object from a file such as run.json. Raise UserError if the file contains anything else."""
    text = read_text(path)
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        data = None
    if not isinstance(data, dict):
        raise UserError("this is not a JSON object; repair or remove the file", file=path)
    return data


def selected_tasks(manifest: Mapping[str, Any]) -> frozenset[str] | None:
    """Return the tasks selected for an evaluation according to `manifest`, its KEY.json; None means all."""
    tasks = manifest.get("tasks")
    return None if tasks is None else frozenset(tasks)


def about_of(run: RunFolder) -> dict[str, Any]:
    """Return the content of run.json, or an empty dictionary if the file is missing."""
    return load_json_object(run.about) if run.about.exists() else {}


def evaluation_key(suite: Suite, *, ablated: bool) -> str:
    """Return the file name of an evaluation without its ending, such as `plus` or `plus-rules-night`."""
    named = suite.house is not None and suite.house.name
    rules = f"{RULES_INFIX}{named}" if named else ""
    return suite.name + rules + ABLATED * ablated


def tasks_to_judge(
    suite: Suite, names: str | None, *, ablated: bool
) -> tuple[frozenset[str] | None, tuple[str, ...]]:
    """Parse task names such as `A, B`. Return tasks to judge (None: all) and tasks without an ablation."""
    wanted = [*suite.tasks] if names is None else [suite.task(name.strip()).name for name in names.split(",")]
    if not ablated:
        return (None if names is None else frozenset(wanted)), ()
    left = tuple(name for name in wanted if suite.tasks[name].ablation is None)
    kept = frozenset(wanted) - frozenset(left)
    if not kept:
        raise UserError(f"none of {', '.join(wanted)} has an ablation; select other tasks")
    return kept, left


def with_judged_worlds(run: RunFolder, suite: Suite, *, ablated: bool) -> Suite:
    """Return a suite with the worlds in which it judged a run (see KEY.json), or unchanged if it did not."""
    path = run.manifest(evaluation_key(suite, ablated=ablated))
    drawn = suite.worlds, suite.seed
    if suite.worlds is None or not path.is_file():
        return suite
    match load_json_object(path):
        case {"worlds": int(worlds), "seed": int(seed)} if worlds > 0 and (worlds, seed) != drawn:
            return suite.with_worlds(worlds, seed)
    return suite


def evaluation_of(
    path: Path, suite: Suite, *, ablated: bool, again: str = "roboeval evaluate"
) -> tuple[RunFolder, str, Suite]:
    """Return a run, the key of its evaluation by a suite, and the suite with that evaluation's worlds.

    Raises UserError if the suite has not judged the run; the message suggests the command `again`.
    """
    run = RunFolder(path)
    suite = with_judged_worlds(run, suite, ablated=ablated)
    key = evaluation_key(suite, ablated=ablated)
    if not run.completions.is_file():
        raise UserError("this is not a run: it contains no completions.jsonl; choose a run", file=path)
    if not run.rows(key).is_file():
        others = ", ".join(name for name in run.judged_by() if name != suite.name)
        only = f' as "{key}", only as {others}; choose with --suite and --rules, or' if others else ";"
        raise UserError(f"the run has not been judged{only} run `{again}`", file=path)
    return run, key, suite
