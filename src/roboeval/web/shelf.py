"""The folder of runs: which runs there are, each found by its name, and nothing that lies elsewhere."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from codebotler.badinput import BadInput
from codebotler.cachedproperty import cached_property
from codebotler.simulator.rules import Rules
from codebotler.terminal import note, shortened
from roboeval.evaluation.run import Run
from roboeval.suites.installed import installed_suites
from roboeval.suites.load import ABLATED, Suite, load_suite, shipped_suites
from roboeval.web.followed import FollowedRun, GoneError
from roboeval.web.seen import Seen

MOST_HELD = 64
"""Evaluations that stay in memory."""


class Shelf:
    """Runs in a folder, for any thread.

    Args:
        folder: in which they lie, or one that is a run itself; it need not be there yet.
        suites: by which runs may have been judged, besides those that ship or are installed.
    """

    def __init__(self, folder: Path, suites: Sequence[Suite] = ()) -> None:
        self.folder = folder
        self._own = {suite.name: suite for suite in suites}
        self._held: OrderedDict[tuple[str, str | None], FollowedRun] = OrderedDict()
        self._lock = threading.Lock()

    @property
    def is_run(self) -> bool:
        """Whether the folder is a run itself."""
        return Run(self.folder).completions.is_file()

    def names(self) -> list[str]:
        """The names of the runs, sorted.

        Raises:
            BadInput: the folder cannot be read.
        """
        if self.is_run:
            return [self.folder.resolve().name]
        return sorted(name for name in _entries(self.folder) if _is_run(self.folder / name))

    def evaluations(self, name: str) -> list[str]:
        """The names of a run's evaluations: those that require everything first.

        Raises:
            BadInput: there is no such run.
        """
        folder = self._run(name).rows("").parent
        keys = (path.stem for path in folder.glob("*.jsonl"))
        return sorted(keys, key=lambda key: (key.endswith(ABLATED), key))

    def open(self, name: str, key: str | None = None) -> FollowedRun:
        """A run, as far as it has been read.

        Args:
            name: its name.
            key: which evaluation; by default the first, or none where there is none.

        Raises:
            BadInput: there is no such run or evaluation.
        """
        run, known = self._run(name), self.evaluations(name)
        if key is None:
            key = known[0] if known else None
        elif key not in known:
            raise BadInput(f'"{shortened(name)}" has no evaluation "{shortened(key)}"')
        with self._lock:
            held = self._held.setdefault((name, key), FollowedRun(run, key, self._within))
            self._held.move_to_end((name, key))
            while len(self._held) > MOST_HELD:
                self._held.popitem(last=False)
            return held

    def suite_of(self, seen: Seen) -> Suite | None:
        """The suite by which a run was judged, or is to be; None if it is not at hand."""
        name = seen.head.get("suite") or seen.about.get("suite")
        return self.suites.get(name if isinstance(name, str) else "paper")

    @cached_property
    def suites(self) -> Mapping[str, Suite]:
        """All that are at hand, by name."""
        return dict(_at_hand()) | self._own

    @property
    def _within(self) -> Path:
        return self.folder.resolve()

    def _run(self, name: str) -> Run:
        """By a name that stands in the folder, letter by letter; so none leads anywhere else."""
        path = self.folder.resolve() if self.is_run else self.folder / name
        if name not in ([path.name] if self.is_run else _entries(self.folder)) or not _is_run(path):
            raise GoneError(f'there is no run "{shortened(name)}" in this folder; perhaps it was deleted')
        if not path.resolve().is_relative_to(self._within):
            raise BadInput(f'"{shortened(name)}" leads out of the folder of runs, where nothing is read')
        return Run(path)


def _at_hand() -> Iterator[tuple[str, Suite]]:
    """What ships and what packages bring; one of theirs that cannot be read is said, and left out."""
    shipped = shipped_suites()
    yield from ((name, load_suite(name)) for name in shipped)
    for name in dict.fromkeys(brought.name for brought in installed_suites()):
        try:
            if name not in shipped:
                yield name, load_suite(name)
        except BadInput as error:
            note(f"a suite is left out: {error}")


def _entries(folder: Path) -> list[str]:
    try:
        return [path.name for path in folder.iterdir()]
    except FileNotFoundError:
        return []
    except OSError as error:
        raise BadInput(f"cannot be read ({error.strerror})", file=folder) from None


def _is_run(path: Path) -> bool:
    """Whether a folder looks like a run; also while its first completion is waited for."""
    if path.name.startswith(".") or not path.name.isprintable():
        return False
    run = Run(path)
    return run.completions.exists() or run.about.exists()


def unknown_suite(name: str) -> Suite:
    """In the place of a suite that is not at hand: it has no task, and explains nothing."""
    return Suite(name, 0, "", Rules(), {}, "")
