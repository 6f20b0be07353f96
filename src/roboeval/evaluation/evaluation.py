"""An evaluation as it lies in a run, set against what there is to judge and what stands there now."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol, TypeVar

from codebotler.badinput import BadInput
from roboeval.evaluation.completions import Completion, Key, Row, how_many, name_of
from roboeval.evaluation.rows import Seal, read_judged
from roboeval.evaluation.run import Run, load_head


class HasKey(Protocol):
    """Something about one completion."""

    @property
    def key(self) -> Key:
        """Of which."""


Keyed = TypeVar("Keyed", bound=HasKey)


@dataclass(frozen=True)
class Scope:
    """What there is to judge.

    Args:
        completions: how many there are by task, also of tasks that were not selected.
        tasks: which were selected; None for all.
        models: who wrote the completions of those; None where nobody recorded it.
    """

    completions: Mapping[str, int]
    tasks: frozenset[str] | None = None
    models: frozenset[str | None] = frozenset()

    @classmethod
    def of(cls, completions: Iterable[Completion], tasks: frozenset[str] | None) -> Scope:
        """Look through completions once."""
        counts: Counter[str] = Counter()
        models: set[str | None] = set()
        for completion in completions:
            counts[completion.task] += 1
            if tasks is None or completion.task in tasks:
                models.add(completion.model)
        return cls(counts, tasks, frozenset(models))

    @property
    def total(self) -> int:
        """How many completions there are to judge."""
        return sum(n for task, n in self.completions.items() if self.selects(task))

    def selects(self, task: str) -> bool:
        """Whether a task is to be judged."""
        return self.tasks is None or task in self.tasks


class Evaluation:
    """The rows of one evaluation of a run, and the completions that they judge.

    Args:
        run: where it is.
        key: the name of its files.

    Raises:
        BadInput: a file of it is missing or wrong.
    """

    def __init__(self, run: Run, key: str) -> None:
        self.run, self.key = run, key
        self.head = load_head(run.head(key))
        tasks = self.head.get("tasks")
        if tasks is not None and not (isinstance(tasks, list) and all(isinstance(t, str) for t in tasks)):
            raise BadInput('"tasks" is no list of names; --redo starts over', file=run.head(key))
        self._written: dict[Key, bytes] = {}
        self.scope = Scope.of(self._remembered(), None if tasks is None else frozenset(tasks))
        self.count = 0
        self.stale: dict[Key, None] = {}  # rows whose programs were changed or are gone

    def _remembered(self) -> Iterator[Completion]:
        for completion in self.run.source().read():
            key = sys.intern(completion.task), completion.prompt, completion.index
            self._written[key] = bytes.fromhex(completion.program_sha256)
            yield completion

    def rows(self) -> Iterator[Row]:
        """Read the rows from the start; `count` and `stale` are about those read so far.

        Raises:
            BadInput: a line is no row of an evaluation, or, once all were read, they are others than those
                of the finished evaluation.
        """
        self.stale.clear()
        self.count = 0
        path, programs = self.run.rows(self.key), self.run.programs(self.key)
        for _, row, judged in read_judged(path, programs, self.head):
            self._see((row["task"], row["prompt"], row["index"]), judged)
            yield row

    def read_by(self, reader: Callable[[Iterator[bytes]], Iterator[Keyed]]) -> Iterator[Keyed]:
        """Have the rows read elsewhere, as `rows` reads them here; for those who do it on many cores.

        Args:
            reader: gets the lines of all whole rows, and says for each in turn of which completion it is.

        Raises:
            BadInput: as `rows` does.
        """
        self.stale.clear()
        self.count = 0
        programs = self.run.programs(self.key)
        hashes = programs.read_text(errors="replace").split("\n")[:-1] if programs.exists() else []
        path, seal = self.run.rows(self.key), Seal()
        try:
            for number, read in enumerate(reader(self._lines(seal))):
                self._see(read.key, hashes[number] if number < len(hashes) else None)
                yield read
        except BadInput as error:
            if error.line is None or error.file is not None:
                raise
            raise BadInput(f"{error.sentence}; --redo starts over", file=path, line=error.line) from None
        seal.check(self.head, path)

    def _lines(self, seal: Seal) -> Iterator[bytes]:
        with self.run.rows(self.key).open("rb") as file:
            for line in file:
                seal.add(line)
                if line.endswith(b"\n") and line.strip():
                    yield line

    def _see(self, key: Key, judged: str | None) -> None:
        written = self._written.get(key)
        self.count += 1
        if written is None or written.hex() != judged:
            self.stale[key] = None

    def judged(self) -> Iterator[Completion]:
        """Read the completions but those of the stale rows, whose verdicts are on other programs."""
        return (completion for completion in self.run.source().read() if completion.key not in self.stale)

    def complaint(self) -> str | None:
        """What is to be said about stale rows, if any of those read so far are."""
        if not self.stale:
            return None
        first, others = name_of(next(iter(self.stale))), len(self.stale) - 1
        rows = f"{first} and {others:,} other {'rows' if others > 1 else 'row'} judge"
        if not others:
            rows = f"{first} judges"
        return f"{rows} another program than stands in {self.run.completions} now"

    def unfinished(self) -> str | None:
        """What is to be said if there is more to judge than the rows that were read."""
        total = self.scope.total
        return None if self.count >= total else f"{self.count:,} of {how_many(total)} judged"
