"""Completions that somebody names: a run, a file, published programs, or recorded ones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.core.files import MAX_ROW, parse_row, read_lines
from codebotler.models.recorded import RECORDED_NAMES, RecordedModel, open_recorded
from roboeval.evaluation.runs.completions import COMPLETIONS, EXAMPLE, Completion, read_completions
from roboeval.evaluation.runs.folder import Run
from roboeval.evaluation.runs.published import passed_over, published_completions
from roboeval.suites.load import Suite


@dataclass(frozen=True)
class Source:
    """Completions that somebody names."""

    completions: Sequence[Completion]  # each known to the suite
    run: Run | None = None  # in which they stand
    left_aside: str | None = None  # a warning about files that are none

    def of(self, tasks: frozenset[str] | None) -> list[Completion]:
        """Those of some tasks, or all."""
        return [one for one in self.completions if tasks is None or one.task in tasks]


def open_source(text: str, suite: Suite) -> Source:
    """Read a run folder, a .jsonl file or pipe, a folder or zip of published .py, or `recorded:NAME`."""
    if not text:
        raise UserError("the argument is empty; name a run, a .jsonl, or a folder or zip of .py")
    path = Path(text)
    if text.partition(":")[0] == "recorded" and not path.exists():
        return Source([*recorded_completions(text, suite)])
    if not path.exists():
        raise UserError(
            "there is no such file or folder; name a run, a .jsonl, or a folder or zip of .py", file=path
        )
    if (path / COMPLETIONS).is_file():
        return Source([*Run(path).read(suite)], Run(path))
    if path.is_dir() or path.suffix == ".zip":
        return Source([*published_completions(path, suite)], left_aside=passed_over(path))
    if path.suffix == ".py":
        raise UserError(f"is one program; write it as a row of a .jsonl: {EXAMPLE}", file=path)
    return Source([*read_completions(path, suite)])


LONGEST_ANSWER = 10 * MAX_ROW  # bytes; it may say more than we keep


def is_answers(path: Path) -> bool:
    """Whether a file begins like one of requests to a batch endpoint, or of its answers."""
    if not path.is_file():
        return False
    _, line = next(read_lines(path, limit=LONGEST_ANSWER), (0, b""))
    try:
        row = parse_row(line)
    except UserError:
        return False
    return row is not None and "custom_id" in row


def recorded_model_for(name: str, suite: Suite) -> RecordedModel:
    """A recorded model that also knows the solutions of a suite.

    Raises:
        UserError: there is no such model.
    """
    model = open_recorded(name, None if suite.folder is None else suite.folder / "solutions")
    short = model.name.removeprefix("recorded:")
    if short not in RECORDED_NAMES:
        return model
    known = {one.instruction: one.replies_of(short) for one in suite.recorded}
    return replace(model, replies={**model.replies, **known})


def recorded_completions(name: str, suite: Suite) -> Iterator[Completion]:
    """Every reply that a recorded model has for a suite's prompts, as completions.

    Raises:
        UserError: there is no such model or suite, or the model knows none of its instructions.
    """
    model = recorded_model_for(name, suite)
    found = False
    for task in suite.tasks.values():
        for prompt, instruction in enumerate(task.prompts):
            for index, reply in enumerate(model.replies.get(instruction, ())):
                found = True
                yield Completion(
                    task=task.name,
                    prompt=prompt,
                    index=index,
                    instruction=instruction,
                    model=model.name,
                    program=reply.program,
                )
    if not found:
        raise UserError(f'{name} knows no instruction of the suite "{suite.name}"')
