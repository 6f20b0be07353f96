"""What completions a run shall have, how they are asked for, and which of them it has already."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from codebotler import __version__
from codebotler.badinput import BadInput
from codebotler.models.base import Settings
from codebotler.prompts import template_hash
from roboeval.evaluation.completions import Key, name_of, read_completions
from roboeval.evaluation.run import Run, load_head
from roboeval.suites.load import Suite

OF_NO_WEIGHT = ("timeout", "base_url")  # settings that do not change what a model says
CALLED = {"template": "prompt template"}
LONGEST = 24  # characters of a value that a sentence can bear


@dataclass(frozen=True)
class Order:
    """Which completions a run shall have.

    Args:
        suite: whose instructions are given to the model.
        tasks: which of its tasks; all by default.
        num_completions: how many for each prompt, at least 1.
    """

    suite: Suite
    tasks: frozenset[str] | None = None
    num_completions: int = 50

    def wanted(self) -> list[Key]:
        """All of them: the first of every prompt, then the second, so that a part is a part of every task."""
        prompts = [
            (task.name, prompt)
            for task in self.suite.tasks.values()
            if self.tasks is None or task.name in self.tasks
            for prompt in range(len(task.prompts))
        ]
        return [(*prompt, index) for index in range(self.num_completions) for prompt in prompts]

    def instruction(self, key: Key) -> str:
        """What the model is told for one of them."""
        return self.suite.tasks[key[0]].prompts[key[1]]


@dataclass
class Used:
    """The tokens that completions took, as far as the model told."""

    input_tokens: int = 0
    output_tokens: int = 0

    def add(self, usage: object) -> None:
        """Add those of a row of completions.jsonl."""
        if isinstance(usage, dict):
            self.input_tokens += _count(usage.get("input_tokens"))
            self.output_tokens += _count(usage.get("output_tokens"))

    @property
    def total(self) -> int:
        """All of them."""
        return self.input_tokens + self.output_tokens


def _count(number: object) -> int:
    return number if isinstance(number, int) else 0


def found(run: Run, order: Order) -> tuple[set[Key], Used]:
    """The completions that a run has, and the tokens they took.

    Raises:
        BadInput: one is of another instruction than the suite has now.
    """
    done: set[Key] = set()
    used = Used()
    if run.completions.stat().st_size:
        for completion in _rows(run, order):
            done.add(completion.key)
            used.add(completion.more.get("usage"))
    return done, used


def _rows(run: Run, order: Order) -> Iterator[Any]:
    for completion in read_completions(run.completions, order.suite):
        if completion.instruction != order.instruction(completion.key):
            raise BadInput(
                f"{name_of(completion.key)} was asked for with another instruction than the suite has now; "
                "name another folder",
                file=run.completions,
            )
        yield completion


def head(run: Run, order: Order, model: str, settings: Settings) -> dict[str, Any]:
    """What run.json is to say.

    Args:
        run: which has one already if this goes on with something.
        order: what is asked for now.
        model: the name of the model.
        settings: how it is asked.

    Raises:
        BadInput: the run holds completions that were asked for otherwise.
    """
    alike: dict[str, Any] = {
        "model": model,
        "settings": {name: value for name, value in asdict(settings).items() if name not in OF_NO_WEIGHT},
        "template": template_hash(),
        "suite": order.suite.name,
    }
    now = {
        "num_completions": order.num_completions,
        "tasks": None if order.tasks is None else sorted(order.tasks),
        "base_url": settings.base_url,
        "codebotler": __version__,
        "python": platform.python_version(),
        "started": now_in_words(),
        "ended": None,
        "usage": asdict(Used()),
        "possibly_paid_twice": 0,
    }
    if not run.about.exists():
        if run.completions.exists() and run.completions.stat().st_size:
            raise BadInput(
                "is missing, so that nobody knows how the completions were asked for; name another folder",
                file=run.about,
            )
        return alike | now
    was = load_head(run.about)
    if not isinstance(was.get("settings"), dict):
        raise BadInput(
            "holds completions that were brought from elsewhere; name another folder", file=run.path
        )
    _expect_alike(run.about, was, alike)
    kept = {name: was.get(name) for name in ("started", "ended")}
    kept |= {"possibly_paid_twice": _count(was.get("possibly_paid_twice"))}
    return alike | now | kept


def _expect_alike(path: Path, was: dict[str, Any], alike: dict[str, Any]) -> None:
    then = {**was, **was["settings"]}
    now = {**alike, **alike["settings"]}
    for name, value in now.items():
        if name != "settings" and then.get(name) != value:
            raise BadInput(
                f"the completions were asked for with another {CALLED.get(name, name.replace('_', '-'))} "
                f"({_brief(then.get(name))}, now {_brief(value)}); name another folder to begin anew",
                file=path,
            )


def _brief(value: object) -> str:
    text = "none" if value is None else str(value)
    return text if len(text) <= LONGEST else text[: LONGEST - 12] + "..."


def now_in_words() -> str:
    """The time now, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")
