"""Defines completions, and reads them from files of JSON lines."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from codebotler.core.errors import UserError
from codebotler.core.files import MAX_ROW, parse_row, read_lines, to_line
from codebotler.core.text.words import counted
from codebotler.models.no_program import NO_PROGRAM_KINDS, NoProgram, classify_reply, is_cut_off
from codebotler.prompts.extract import read_reply
from roboeval.evaluation.runs.endings import ENDINGS
from roboeval.suites.load import Suite

COMPLETIONS = "completions.jsonl"
EXAMPLE = '{"task": "LunchTime", "prompt": 0, "index": 0, "program": "def task_program(): ..."}'

NUMBER_LIMIT = 1_000_000_000
CompletionKey: TypeAlias = tuple[str, int, int]
KEY = ("task", "prompt", "index")  # names of the key's parts in tables and rows
REQUIRED = (*KEY, "program")
FIELDS = (*REQUIRED, "instruction", "model")
NO_PROGRAM_COLUMN = "no_program"  # the table column for replies without a program


class MissionEnd(NamedTuple):
    """The world in which an agent's mission took place, and how the mission ended."""

    world: int  # the index of the world in its task
    ending: str  # one of `ENDINGS`, such as `TurnLimit`


@dataclass(frozen=True, kw_only=True)
class Completion:
    """A row of completions.jsonl: a program that a model wrote for an instruction.

    Args:
        task: the task's name.
        prompt: the number of the phrasing, from 0, below a billion.
        index: the number of the sample, from 0, below a billion.
        program: the source text without the rest of the reply; it is judged exactly as it is.
        instruction: the instruction in the prompt, or None if it was not recorded.
        model: the name of the model, or None if it was not recorded.
        more: other entries of the row, such as `usage`, `raw_reply` and `finish_reason`.

    Raises:
        UserError: an argument has the wrong type or is out of range.
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
            if type(number) is not int or not 0 <= number < NUMBER_LIMIT:
                allowed = f"a whole number from 0 to {NUMBER_LIMIT - 1:,}"
                raise UserError(f"the {name} is {number!r}, but it must be {allowed}")
        for name in ("task", "program", "instruction", "model"):
            text = getattr(self, name)
            if not isinstance(text, str) and (text is not None or name in REQUIRED):
                raise UserError(f"the {name} is {text!r}, but it must be a string")
        if "world" in self.more and self.mission is None:
            raise UserError(f'a mission needs a "world" from 0 and an "ending", one of {", ".join(ENDINGS)}')
        if (kind := self.more.get(NO_PROGRAM_COLUMN)) not in (None, *NO_PROGRAM_KINDS):
            choices = ", ".join(NO_PROGRAM_KINDS)
            raise UserError(f'"{NO_PROGRAM_COLUMN}" is {kind!r}; use null or one of {choices}')

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> Completion:
        """Create a completion from a row of a file. Raise UserError if an entry is missing or invalid."""
        more = dict(row)
        known = {name: more.pop(name) for name in FIELDS if name in more}
        for name in REQUIRED:
            if name not in known:
                raise UserError(f'the entry "{name}" is missing; a row looks like {EXAMPLE}')
        return cls(**known, more=more)

    @property
    def row(self) -> dict[str, Any]:
        """Return the completion as a row of completions.jsonl."""
        known = {name: getattr(self, name) for name in FIELDS}
        return {name: value for name, value in known.items() if value is not None} | dict(self.more)

    @property
    def key(self) -> CompletionKey:
        """The task, prompt and index, which together identify the completion in its run."""
        return self.task, self.prompt, self.index

    @property
    def finish_reason(self) -> str | None:
        """Return the server's reason for ending the reply, such as `stop` or `length`, or None if unknown."""
        reason = self.more.get("finish_reason")
        return reason if isinstance(reason, str) else None

    @property
    def is_cut_off(self) -> bool:
        """Whether the reply ended at the token limit, even if the program is complete."""
        return is_cut_off(self.finish_reason) or self.more.get(NO_PROGRAM_COLUMN) == "cut-off"

    @property
    def mission(self) -> MissionEnd | None:
        """Return the world and ending of an agent's mission, or None if the model wrote a program."""
        world, ending = self.more.get("world"), self.more.get("ending")
        is_valid = type(world) is int and 0 <= world < NUMBER_LIMIT and ending in ENDINGS
        return MissionEnd(world, ending) if is_valid else None  # type: ignore[arg-type]  # `is_valid` has checked them

    @property
    def mode(self) -> str:
        """Return how the model was used: `program`, `agent`, or `replan` for one program after another."""
        return str(self.more.get("mode", "program"))

    @property
    def turns(self) -> int:
        """The number of the model's replies: 1 for a program, often more for a mission of an agent."""
        turns = self.more.get("turns", 1)
        return turns if type(turns) is int else 1

    @property
    def no_program(self) -> NoProgram | None:
        """Return why the reply contained no program, or None if it contained one or the reason is unknown.

        Rows written by other tools are classified like new replies. Raises EngineError if an isolated process
        is needed for this and cannot be started.
        """
        if NO_PROGRAM_COLUMN in self.more:
            kind: NoProgram | None = self.more[NO_PROGRAM_COLUMN]
            return kind
        reply = self.more.get("raw_reply")
        is_chat = isinstance(reply, str) and not (self.model or "").startswith("completions:")
        has_code = read_reply(str(reply)).has_code if is_chat else bool(self.program.strip())
        text = reply if isinstance(reply, str) else None
        return classify_reply(text, self.program, self.finish_reason, has_code=has_code)

    @property
    def program_sha256(self) -> str:
        """Return the hexadecimal SHA-256 of the program in UTF-8 (with `errors="surrogatepass"`)."""
        return hashlib.sha256(self.program.encode(errors="surrogatepass")).hexdigest()


def row_for(key: CompletionKey, instruction: str, model: str, more: Mapping[str, Any]) -> dict[str, Any]:
    """Return a row of completions.jsonl. `more` holds the entries about the reply, such as `program`."""
    return {**dict(zip(KEY, key, strict=True)), "instruction": instruction, "model": model, **more}


def read_completions(
    path: str | PathLike[str], suite: Suite | None = None, *, growing: bool = False
) -> Iterator[Completion]:
    """Read the completions in a file of JSON lines, one after another.

    Args:
        path: the file.
        suite: the suite whose tasks and prompts are allowed; any by default.
        growing: whether to ignore an incomplete last line, because a process may still write to the file.

    Raises:
        UserError: the file is missing or empty, or a row is invalid, unknown to the suite, or a duplicate.
    """
    path = Path(path)
    seen: dict[CompletionKey, int] = {}  # line numbers
    for number, line in read_lines(path):
        try:
            if line.strip() and (completion := _completion(line, suite, growing=growing)) is not None:
                _expect_new(completion.key, seen, number)
                yield completion
        except UserError as error:
            raise UserError(error.sentence, file=path, line=number) from None
    if not seen:
        raise UserError(f"the file contains no completion; a row looks like {EXAMPLE}", file=path)


def _completion(line: bytes, suite: Suite | None, *, growing: bool) -> Completion | None:
    row = parse_row(line, EXAMPLE)
    if row is None:
        if growing and not line.endswith(b"\n"):
            return None
        raise UserError(f"this line is not JSON; a row looks like {EXAMPLE}")
    completion = Completion.of(row)
    if 2 * len(line) > MAX_ROW:  # shorter rows cannot grow beyond the limit
        check_length(row, None)
    if suite is not None and (
        problem := find_key_fault(completion.key, suite) or _is_of_other(completion, suite)
    ):
        raise UserError(problem)
    return completion


def _is_of_other(completion: Completion, suite: Suite) -> str | None:
    """Return an error message if a completion belongs to another seed or version of the task families."""
    if not suite.is_generated or completion.instruction is None:
        return None
    if completion.instruction == suite.tasks[completion.task].prompts[completion.prompt]:
        return None
    differs = f'{name_of(completion.key)} has a different instruction than "{suite.name}"'
    return f"{differs}; see run.json for the right suite and version"


def _expect_new(key: CompletionKey, seen: dict[CompletionKey, int], number: int) -> None:
    first_line = seen.setdefault(key, number)
    if first_line != number:
        raise UserError(f"duplicates {name_of(key)} on line {first_line}; remove one of the two lines")


def check_length(row: Mapping[str, Any], file: str | None) -> None:
    """Raise UserError if a row is too long to be copied into a run. The error names `file`, if given."""
    if len(to_line(row)) > MAX_ROW:
        raise UserError(f"this row is longer than {MAX_ROW:,} bytes; shorten the program", file=file)


def find_key_fault(key: CompletionKey, suite: Suite) -> str | None:
    """Return an error message if a suite lacks the task or prompt of a key, or None if it has both."""
    task = suite.tasks.get(str(key[0]))
    if task is None:
        return f'the suite "{suite.name}" has no task "{key[0]}"; its tasks are {", ".join(suite.tasks)}'
    there_are = f"the task has prompts 0 to {len(task.prompts) - 1}"
    prompt: object = key[1]
    if isinstance(prompt, bool) or not hasattr(prompt, "__index__"):  # NumPy integers are allowed
        return f"the prompt is {prompt!r}, not a whole number; {there_are}"
    return None if 0 <= key[1] < len(task.prompts) else f'"{key[0]}" has no prompt {prompt}; {there_are}'


def name_of(key: CompletionKey) -> str:
    """Format a key as TASK/PROMPT/INDEX, such as `LunchTime/0/12`."""
    return "/".join(map(str, key))


def how_many(count: int) -> str:
    """Format a number of completions, such as `2,000 completions`."""
    return counted(count, "completion")


def recorded_suffix(models: Collection[str | None]) -> str:
    """Return ` (programs written by hand)` for a title if any model is recorded, or else an empty string."""
    recorded = [model for model in models if model is not None and model.startswith("recorded:")]
    if not recorded:
        return ""
    return f" ({'' if len(recorded) == len(models) else 'some '}programs written by hand)"
