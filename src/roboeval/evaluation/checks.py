"""What the check says of a run's programs, kept in the run, so that no program is checked twice."""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Iterable, Iterator, Mapping
from functools import partial

from codebotler import __version__
from codebotler.badinput import BadInput
from codebotler.checker import Check, Settings, check_on
from codebotler.files import Appender, read_rows, to_line, to_text, write_whole
from codebotler.simulator.engine import digest
from codebotler.simulator.imagined import Plan
from codebotler.simulator.lane import Lane
from roboeval.evaluation.completions import Completion
from roboeval.evaluation.engines import Local, OpenEngine
from roboeval.evaluation.run import Run, load_head
from roboeval.suites.load import Suite


class Checks:
    """What the check says of programs of a run.

    Of the world, the rooms are known and nothing else: those of the first world of the task. The rules of the
    suite hold. What was checked otherwise, or by another version, is forgotten.

    Args:
        run: where results are kept.
        suite: of whose tasks the programs are.
        samples: how many worlds to imagine for each.
        seed: from which they are drawn.
    """

    def __init__(self, run: Run, suite: Suite, *, samples: int = 5, seed: int = 0) -> None:
        self._run, self._name = run, suite.name
        self._settings = Settings(samples=samples, seed=seed, rules=suite.rules)
        self._plans = {task.name: Plan.of(task.scenarios[0].world) for task in suite.tasks.values()}
        self._head = {
            "suite": suite.name,
            "digest": suite.digest,
            "samples": samples,
            "seed": seed,
            "codebotler": __version__,
            "python": ".".join(platform.python_version_tuple()[:2]),
        }
        self.problems: dict[tuple[str, str], list[str]] = {}
        """What is wrong with a program, by its task and its hash."""

    def add(
        self, completions: Iterable[Completion], *, workers: int = 1, engine: OpenEngine | None = None
    ) -> Iterator[list[str]]:
        """Check those programs that were not checked before; yields the problems of each program once.

        Args:
            completions: of tasks of the suite.
            workers: how many programs are checked at the same time.
            engine: where they are, instead of in so many lanes of this machine.

        Raises:
            BadInput: the run is being written, or somebody broke a file of checks.
            EngineError: no isolated process can be started.
            OSError: the disk is full; what was checked before stays.
        """
        with self._run.writing():
            self._begin()
            with contextlib.closing(Appender(self._run.checks(self._name))) as file:
                self._read()
                programs = {(c.task, c.program_sha256): c.program for c in completions}
                yield from (self.problems[key] for key in programs if key in self.problems)
                left = {key: program for key, program in programs.items() if key not in self.problems}
                for key, problems in self._checked(left, engine or Local(workers)):
                    file.append(to_line({"task": key[0], "program_sha256": key[1], "problems": problems}))
                    self.problems[key] = problems
                    yield problems

    def _checked(
        self, programs: Mapping[tuple[str, str], str], engine: OpenEngine
    ) -> Iterator[tuple[tuple[str, str], list[str]]]:
        if not programs:
            return
        checking = partial(checked, self._plans, self._settings)
        works = ((task, program) for (task, _), program in programs.items())
        with engine as opened:
            found = opened.map_distinct(checking, works, name=lambda work: digest(*work), then=sentences)
            yield from zip(programs, found, strict=True)

    def _begin(self) -> None:
        """Keep what was checked alike, and forget anything else."""
        path = self._run.checks_head(self._name)
        path.parent.mkdir(exist_ok=True)
        if not path.exists() or load_head(path) != self._head:
            self._run.checks(self._name).unlink(missing_ok=True)
            write_whole(path, to_text(self._head))

    def _read(self) -> None:
        path = self._run.checks(self._name)
        for number, row in read_rows(path):
            match row:
                case {"task": str(task), "program_sha256": str(program), "problems": list(problems)}:
                    self.problems[task, program] = problems
                case _:
                    raise BadInput("this line tells of no check; delete the file", file=path, line=number)


def checked(plans: Mapping[str, Plan], settings: Settings, lane: Lane, work: tuple[str, str]) -> Check:
    """The check of a program, the second of the two; the first is its task."""
    task, program = work
    return check_on(lane, program, plans[task], settings)


def sentences(check: Check) -> list[str]:
    """What is wrong with a program, in sentences."""
    return [problem.sentence for problem in check.problems]
