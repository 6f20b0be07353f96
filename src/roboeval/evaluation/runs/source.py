"""Reads completions from any source: a run, a file, published programs or recorded models."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.core.files import MAX_ROW, read_lines
from codebotler.models.recorded import RECORDED_NAMES, RecordedModel, open_recorded
from roboeval.evaluation.runs.completions import COMPLETIONS, EXAMPLE, Completion, read_completions
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.evaluation.runs.published import published_completions
from roboeval.suites.load import Suite


@dataclass(frozen=True)
class Source:
    """Completions, and the run that they were read from, if any."""

    completions: Sequence[Completion]  # all completions for tasks of the suite
    run: RunFolder | None = None

    def of(self, tasks: frozenset[str] | None) -> list[Completion]:
        """Return the completions of the given tasks, or of all tasks if None."""
        return [one for one in self.completions if tasks is None or one.task in tasks]


def open_source(text: str, suite: Suite) -> Source:
    """Read completions from a run folder, a .jsonl file, a folder or zip of .py files, or `recorded:NAME`."""
    if not text:
        raise UserError("the argument is empty; name a run, a .jsonl file, or a folder or zip of .py files")
    path = Path(text)
    if text.partition(":")[0] == "recorded" and not path.exists():
        return Source([*recorded_completions(text, suite)])
    if not path.exists():
        raise UserError("does not exist; name a run, .jsonl file, or folder or zip of .py files", file=path)
    if (path / COMPLETIONS).is_file():
        return Source([*RunFolder(path).read(suite)], RunFolder(path))
    if path.is_dir() or path.suffix == ".zip":
        return Source([*published_completions(path, suite)])
    if path.suffix == ".py":
        raise UserError(f"this is a single program; write it as a row of a .jsonl file: {EXAMPLE}", file=path)
    return Source([*read_completions(path, suite)])


MAX_ANSWER_BYTES = 10 * MAX_ROW  # an answer may contain more than we keep


def is_batch_file(path: Path) -> bool:
    """Return whether a file begins with a request to a batch endpoint, or with an answer from one."""
    if not path.is_file():
        return False
    _, line = next(read_lines(path, limit=MAX_ANSWER_BYTES), (0, b""))
    return b'"custom_id"' in line


def recorded_model_for(name: str, suite: Suite) -> RecordedModel:
    """Open a recorded model with the solutions of a suite. Raise UserError if the model does not exist."""
    model = open_recorded(name, None if suite.folder is None else suite.folder / "solutions")
    short = model.name.removeprefix("recorded:")
    if short not in RECORDED_NAMES:
        return model
    known = {one.instruction: one.replies_of(short) for one in suite.recorded}
    return replace(model, replies={**model.replies, **known})


def recorded_completions(name: str, suite: Suite) -> Iterator[Completion]:
    """Yield a recorded model's replies to a suite's prompts. Raise UserError if there are none."""
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
        raise UserError(f'{name} has no program for any instruction of the suite "{suite.name}"')
