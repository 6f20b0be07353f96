"""What is known of a run at a moment: an entry for each completion, and which of them are wanted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

from codebotler.cachedproperty import cached_property
from roboeval.analysis.metrics import Estimate, PromptScore, TaskScore, overall
from roboeval.evaluation.completions import Key


@dataclass(frozen=True, slots=True)
class Written:
    """A completion as far as it is kept in memory.

    Args:
        at: where its line begins, in bytes.
        size: of the line, in bytes.
        digest: the hash of its program.
        model: who wrote it; None where nobody recorded it.
    """

    at: int
    size: int
    digest: bytes
    model: str | None


@dataclass(frozen=True, slots=True)
class Judged:
    """What was judged of a completion, as far as it is kept in memory.

    Args:
        at: where its line begins, in bytes.
        size: of the line, in bytes.
        passed: whether it did what was asked.
        failure_class: of its failure; None if it passed.
        kind: of its failure.
        world: which decided, counted from 0.
        check: that failed there first; None where an error decided.
        worlds: a sign for each: + satisfied, - not, ! ended by an error.
        why: the check or what the error says, to be shown.
    """

    at: int
    size: int
    passed: bool
    failure_class: str | None
    kind: str | None
    world: int | None
    check: str | None
    worlds: str
    why: str


@dataclass(frozen=True, slots=True)
class Entry:
    """A completion.

    Args:
        key: what no other one shares.
        written: None where the completion is not there.
        judged: None where it has not been judged.
        stale: whether another program was judged than stands there now.
    """

    key: Key
    written: Written | None
    judged: Judged | None
    stale: bool = False


@dataclass(frozen=True)
class Wanted:
    """Which completions somebody wants to see; what is None is not narrowed.

    Args:
        task: of this task.
        prompt: of this prompt.
        passed: those that passed, or those that failed.
        failure_class: that failed by this class.
        kind: that failed by this kind.
    """

    task: str | None = None
    prompt: int | None = None
    passed: bool | None = None
    failure_class: str | None = None
    kind: str | None = None

    def takes(self, entry: Entry) -> bool:
        """Whether a completion is among them."""
        task, prompt, _ = entry.key
        if self.task not in {None, task} or self.prompt not in {None, prompt}:
            return False
        if self.passed is None and self.failure_class is None and self.kind is None:
            return True
        judged = entry.judged
        return (
            judged is not None
            and self.passed in {None, judged.passed}
            and self.failure_class in {None, judged.failure_class}
            and self.kind in {None, judged.kind}
        )

    @property
    def of_any_place(self) -> Self:
        """The same in all tasks and prompts."""
        return replace(self, task=None, prompt=None)


@dataclass(frozen=True)
class Cell:
    """A prompt.

    Args:
        task: its task.
        prompt: counted from 0.
        written: how many completions there are.
        judged: how many of them were judged.
        counted: how many of those are of the kind that is asked for.
    """

    task: str
    prompt: int
    written: int
    judged: int
    counted: int

    @property
    def share(self) -> float | None:
        """Of the judged ones, those that are counted; None where none is judged."""
        return self.counted / self.judged if self.judged else None


@dataclass(frozen=True)
class Seen:
    """What is known of an evaluation of a run.

    Args:
        version: another one whenever something has changed.
        name: of the run.
        key: of the evaluation; None where nothing has been judged.
        about: what run.json says.
        head: by what it was judged.
        is_written: whether a process writes the run just now.
        share: how much of its files was read, from 0 to 1.
        faults: what is wrong with lines of its files, in sentences; the first ones.
        fault_count: how many faults there are.
        entries: a completion each.
    """

    version: int = 0
    name: str = ""
    key: str | None = None
    about: Mapping[str, Any] = field(default_factory=dict)
    head: Mapping[str, Any] = field(default_factory=dict)
    is_written: bool = False
    share: float = 0.0
    faults: tuple[str, ...] = ()
    fault_count: int = 0
    entries: tuple[Entry, ...] = ()

    def next(self) -> Seen:
        """The same as something new."""
        return replace(self, version=self.version + 1)

    @cached_property
    def by_key(self) -> Mapping[Key, Entry]:
        """The completions by their keys."""
        return {entry.key: entry for entry in self.entries}

    @cached_property
    def models(self) -> tuple[str | None, ...]:
        """Who wrote the completions, sorted; None where nobody recorded it."""
        models = {entry.written.model for entry in self.entries if entry.written is not None}
        return tuple(sorted(models, key=lambda model: model or ""))

    @cached_property
    def judged(self) -> tuple[tuple[Key, Judged], ...]:
        """The completions that were judged."""
        return tuple((entry.key, entry.judged) for entry in self.entries if entry.judged is not None)

    @cached_property
    def passed_count(self) -> int:
        """How many passed."""
        return sum(one.passed for _, one in self.judged)

    @cached_property
    def mean(self) -> Estimate | None:
        """pass@1 over all prompts; None where nothing was judged."""
        scores = self.scores(())
        return overall(scores, 1) if scores else None

    @cached_property
    def written_count(self) -> int:
        """How many completions there are."""
        return sum(entry.written is not None for entry in self.entries)

    @cached_property
    def to_judge(self) -> int:
        """How many of them were to be judged."""
        tasks = self.head.get("tasks")
        chosen = set(map(str, tasks)) if isinstance(tasks, list) else None
        return sum(e.written is not None and (chosen is None or e.key[0] in chosen) for e in self.entries)

    @cached_property
    def stale_count(self) -> int:
        """How many verdicts are on other programs than stand there now."""
        return sum(entry.stale for entry in self.entries)

    @cached_property
    def kinds(self) -> Mapping[tuple[str, str], int]:
        """How many failed by each class and kind, the most frequent first."""
        found = Counter(
            (one.failure_class, one.kind)
            for _, one in self.judged
            if one.failure_class is not None and one.kind is not None
        )
        return dict(sorted(found.items(), key=lambda item: (-item[1], item[0])))

    def scores(self, order: Sequence[str]) -> tuple[TaskScore, ...]:
        """How often what was judged passed, by task and prompt.

        Args:
            order: of the tasks; others come after these.
        """
        passed = Wanted(passed=True)
        prompts: dict[str, list[PromptScore]] = {}
        for cell in self.cells(passed, order):
            if cell.judged:
                score = PromptScore(cell.task, cell.prompt, cell.judged, cell.counted)
                prompts.setdefault(cell.task, []).append(score)
        return tuple(TaskScore(task, tuple(scores)) for task, scores in prompts.items())

    def cells(self, counted: Wanted, order: Sequence[str]) -> list[Cell]:
        """All prompts, in order.

        Args:
            counted: which completions are counted in each.
            order: of the tasks; others come after these.
        """
        found: dict[tuple[str, int], list[int]] = {}
        wanted = counted.of_any_place
        for entry in self.entries:
            cell = found.setdefault(entry.key[:2], [0, 0, 0])
            cell[0] += entry.written is not None
            if entry.judged is not None:
                cell[1] += 1
                cell[2] += wanted.takes(entry)
        place = {task: number for number, task in enumerate(order)}
        ordered = sorted(found, key=lambda at: (place.get(at[0], len(place)), at))
        return [Cell(task, prompt, *found[task, prompt]) for task, prompt in ordered]

    def chosen(self, wanted: Wanted, order: Sequence[str]) -> list[Entry]:
        """The completions that somebody wants to see, in order.

        Args:
            wanted: which.
            order: of the tasks; others come after these.
        """
        place = {task: number for number, task in enumerate(order)}

        def where(entry: Entry) -> tuple[int, Key]:
            return place.get(entry.key[0], len(place)), entry.key

        return sorted(filter(wanted.takes, self.entries), key=where)

    def neighbours(self, key: Key, wanted: Wanted, order: Sequence[str]) -> Iterator[Key | None]:
        """The completions before and after one, among those that somebody wants to see; None at an end."""
        keys = [entry.key for entry in self.chosen(wanted, order)]
        at = keys.index(key) if key in keys else None
        yield keys[at - 1] if at else None
        yield keys[at + 1] if at is not None and at + 1 < len(keys) else None
