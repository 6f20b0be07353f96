"""Rows of completions: read with line numbers, and named."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias

from codebotler.core.errors import UserError
from codebotler.core.files import MAX_ROW, parse_row, read_lines, to_line
from codebotler.core.words import counted
from codebotler.models.base import Reply
from codebotler.models.no_program import NO_PROGRAM_KINDS, NoProgram, classify_reply, is_cut_off
from codebotler.prompts.extract import read_reply
from roboeval.evaluation.runs.rows import add_or_raise
from roboeval.suites.load import Suite

COMPLETIONS = "completions.jsonl"
EXAMPLE = '{"task": "LunchTime", "prompt": 0, "index": 0, "program": "def task_program(): ..."}'

MOST = 1_000_000_000
Key: TypeAlias = tuple[str, int, int]
KEY = ("task", "prompt", "index")  # as columns of tables and names in rows
REQUIRED = (*KEY, "program")
FIELDS = (*REQUIRED, "instruction", "model")
NO_PROGRAM = "no_program"  # its column


@dataclass(frozen=True, kw_only=True)
class Completion:
    """One row of completions.jsonl: a program that a model wrote for an instruction.

    Args:
        task: the task's name.
        prompt: which phrasing, counted from 0, below a billion.
        index: which sample, counted from 0, below a billion.
        program: the cleaned source; judged exactly as it stands.
        instruction: the sentence that the model was asked for; None where nobody recorded it.
        model: who wrote it.
        more: what else its row says, such as `usage`, `raw_reply` and `finish_reason`.

    Raises:
        UserError: one of them is not of its kind or range.
    """

    task: str
    prompt: int
    index: int
    program: str = field(repr=False)
    instruction: str | None = field(default=None, repr=False)
    model: str | None = None
    more: Mapping[str, Any] = field(default_factory=dict, repr=False, hash=False)

    def __post_init__(self) -> None:
        for name, number in (("prompt", self.prompt), ("index", self.index)):
            if type(number) is not int or not 0 <= number < MOST:
                raise UserError(
                    f"the {name} is {number!r}, but must be a whole number from 0 to {MOST - 1:,}"
                )
        for name in ("task", "program", "instruction", "model"):
            text = getattr(self, name)
            if not isinstance(text, str) and (text is not None or name in REQUIRED):
                raise UserError(f"the {name} is {text!r}, not a text")
        if (kind := self.more.get(NO_PROGRAM)) not in (None, *NO_PROGRAM_KINDS):
            raise UserError(f'"{NO_PROGRAM}" is {kind!r}; use null or one of {", ".join(NO_PROGRAM_KINDS)}')

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> Completion:
        """The completion that a row of completions.jsonl says.

        Raises:
            UserError: something is missing in it, or not of its kind or range.
        """
        more = dict(row)
        known = {name: more.pop(name) for name in FIELDS if name in more}
        for name in REQUIRED:
            if name not in known:
                raise UserError(f'"{name}" is missing')
        return cls(**known, more=more)

    @property
    def row(self) -> dict[str, Any]:
        """The row of completions.jsonl that says it."""
        known = {name: getattr(self, name) for name in FIELDS}
        return {name: value for name, value in known.items() if value is not None} | dict(self.more)

    @property
    def key(self) -> Key:
        """What no other row of a run shares."""
        return self.task, self.prompt, self.index

    @property
    def finish_reason(self) -> str | None:
        """Why the reply ended, as the server said it; None if nobody recorded it."""
        reason = self.more.get("finish_reason")
        return reason if isinstance(reason, str) else None

    @property
    def is_cut_off(self) -> bool:
        """Whether the reply ended at the limit of tokens, whether or not the program is whole."""
        return is_cut_off(self.finish_reason)

    @property
    def no_program(self) -> NoProgram | None:
        """Why the reply held no program; None if it held one, or if the row leaves that open.

        Rows of earlier versions and of other tools are read as if the reply had just arrived.

        Raises:
            EngineError: no isolated process can be started.
        """
        if NO_PROGRAM in self.more:
            kind: NoProgram | None = self.more[NO_PROGRAM]
            return kind
        reply = self.more.get("raw_reply")
        is_chat = isinstance(reply, str) and not (self.model or "").startswith("completions:")
        has_code = read_reply(str(reply)).has_code if is_chat else bool(self.program.strip())
        text = reply if isinstance(reply, str) else None
        return classify_reply(text, self.program, self.finish_reason, has_code=has_code)

    @property
    def program_sha256(self) -> str:
        """The hash of the program, half surrogate pairs included, in 64 hexadecimal digits."""
        return hashlib.sha256(self.program.encode(errors="surrogatepass")).hexdigest()


def reply_row(key: Key, instruction: str, model: str, reply: Reply) -> dict[str, Any]:
    """The row of completions.jsonl for a model's reply to the instruction of a key."""
    of_whom = {**dict(zip(KEY, key, strict=True)), "instruction": instruction, "model": model}
    return {**of_whom, **reply.data()}


def read_completions(
    path: str | PathLike[str],
    suite: Suite | None = None,
    *,
    growing: bool = False,
    name: Path | str | None = None,
    faults: list[UserError] | None = None,
) -> Iterator[Completion]:
    """Read completions from a file of JSON lines.

    Args:
        path: the file.
        suite: whose tasks and prompts they must be of; any by default.
        growing: whether it stands in a run, where a torn last line is passed over.
        name: what sentences call the file; its path by default.
        faults: gets what is wrong with lines, which are then left out, rather than that it is raised.

    Raises:
        UserError: the file is missing or empty, or a row is wrong, unknown to the suite, or repeats another.
    """
    path = Path(path)
    name = name or path
    seen: dict[Key, int] = {}  # the lines
    try:
        for number, line in read_lines(path, name=name):
            try:
                if line.strip() and (completion := _completion(line, suite, growing=growing)) is not None:
                    _expect_new(completion.key, seen, number)
                    yield completion
            except UserError as error:
                add_or_raise(UserError(error.sentence, file=name, line=number), faults)
    except UserError as error:
        add_or_raise(error, faults)
    if not seen and faults is None:
        raise UserError("there is no completion in it", file=name)


def _completion(line: bytes, suite: Suite | None, *, growing: bool) -> Completion | None:
    """The completion that a line says; None where the line is torn."""
    row = parse_row(line, EXAMPLE)
    if row is None:
        if growing and not line.endswith(b"\n"):
            return None
        raise UserError(f"this line is not JSON; a row looks like {EXAMPLE}")
    completion = Completion.of(row)
    if 2 * len(line) > MAX_ROW:  # else it stays short enough, however it is written
        check_length(row, None)
    if suite is not None and (problem := unknown(completion.key, suite) or _is_of_other(completion, suite)):
        raise UserError(problem)
    return completion


def _is_of_other(completion: Completion, suite: Suite) -> str | None:
    """What is wrong with a completion for another seed or version of families; None if nothing."""
    if suite.families is None or completion.instruction is None:
        return None
    if completion.instruction == suite.tasks[completion.task].prompts[completion.prompt]:
        return None
    return (
        f'{name_of(completion.key)} is for another instruction than "{suite.name}" has; '
        "run.json names its suite and version"
    )


def _expect_new(key: Key, seen: dict[Key, int], number: int) -> None:
    first_line = seen.setdefault(key, number)
    if first_line != number:
        raise UserError(f"{name_of(key)} is here again; it was already in line {first_line}")


def check_length(row: Mapping[str, Any], file: object, line: int | None = None) -> None:
    """Raise UserError if a row would be too long to be read again once it is copied into a run."""
    if len(to_line(row)) > MAX_ROW:
        sentence = f"this row is longer than {MAX_ROW:,} bytes; shorten the program"
        raise UserError(sentence, file=str(file), line=line)


def unknown(key: Key, suite: Suite) -> str | None:
    """What is wrong with a completion's task or prompt, as a user of Python may give it; None if nothing."""
    task = suite.tasks.get(str(key[0]))
    if task is None:
        return f'the suite "{suite.name}" has no task "{key[0]}"; its tasks are {", ".join(suite.tasks)}'
    there_are = f"the task has prompts 0 to {len(task.prompts) - 1}"
    prompt: object = key[1]
    if isinstance(prompt, bool) or not hasattr(prompt, "__index__"):  # numbers of NumPy are right
        return f"the prompt is {prompt!r}, not a whole number; {there_are}"
    return None if 0 <= key[1] < len(task.prompts) else f"{name_of(key)}: {there_are}"


def name_of(key: Key) -> str:
    """How a person names a row: TASK/PROMPT/INDEX."""
    return "/".join(map(str, key))


def how_many(count: int) -> str:
    """A number of completions: `1 completion`, `2,000 completions`."""
    return counted(count, "completion")


def by_hand(models: Collection[str | None]) -> str:
    """What a title adds if some models are recorded programs, which stand for no real model."""
    recorded = [model for model in models if model is not None and model.startswith("recorded:")]
    if not recorded:
        return ""
    return f" ({'' if len(recorded) == len(models) else 'some '}programs written by hand)"
