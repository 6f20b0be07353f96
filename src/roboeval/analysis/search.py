"""Which completions of a judged run did something: a formula tried on all their traces, on all cores."""

from __future__ import annotations

import json
import multiprocessing
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import chain, islice

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from codebotler.badinput import BadInput
from codebotler.rtl import CannotJudge, Formula, holds, parse
from codebotler.terminal import visible
from codebotler.trace import Trace
from codebotler.tracefile import trace_from
from roboeval.analysis.cluster import trimmed
from roboeval.evaluation.completions import Key, how_many, name_of
from roboeval.evaluation.rows import NO_ROW, row_of
from roboeval.evaluation.tables import RowData, key_of

BATCH = 100  # rows that a process looks through at a time
SMALL = 20  # batches for which other processes are not worth their start


@dataclass(frozen=True)
class Question:
    """What is looked for.

    Args:
        formula: an RTL formula; None matches every trace.
        negated: whether it shall not hold.
        task: only completions of this task.
        world: only in the world of this number, counted from 1, or whose `about` this is.
    """

    formula: str | None = None
    negated: bool = False
    task: str | None = None
    world: str | None = None


@dataclass(frozen=True)
class Found:
    """What a row says to a question.

    Args:
        key: the completion.
        passed: whether it passed.
        worlds: numbers, from 1, and names of the worlds in which it does what is looked for.
        row: of a completion that failed and does it somewhere, as `trimmed` leaves it.
        undecided: those of the worlds in which nobody knows, since the trace was too long to be kept.
    """

    key: Key
    passed: bool
    worlds: tuple[tuple[int, str], ...]
    row: RowData | None
    undecided: tuple[tuple[int, str], ...] = ()


def asked_of(row: RowData, question: Question, formula: Formula | None) -> Found:
    """What one row says.

    Args:
        row: of an evaluation.
        question: what is looked for.
        formula: its formula, parsed.
    """
    worlds, undecided = [], []
    for number, verdict in _asked(row, question):
        if formula is not None and "cut" in verdict:
            undecided.append((number, verdict["world"]))
        elif formula is None or _holds(formula, verdict["trace"]) != question.negated:
            worlds.append((number, verdict["world"]))
    kept = trimmed(row) if worlds and not row["passed"] else None
    return Found(key_of(row), row["passed"], tuple(worlds), kept, tuple(undecided))


def _asked(row: RowData, question: Question) -> Iterator[tuple[int, RowData]]:
    """The verdicts that a question is about, counted from 1."""
    if question.task not in {None, row["task"]}:
        return
    for number, verdict in enumerate(row["verdicts"], 1):
        if question.world in {None, str(number)} or verdict["world"].lower() == str(question.world).lower():
            yield number, verdict


def _holds(formula: Formula, data: Iterable[object]) -> bool:
    trace: Trace = _driven(trace_from(data, further=True))
    try:
        return holds(formula, trace)
    except CannotJudge:
        return False


def _driven(trace: Trace) -> Trace:
    """The trace with each event where the last drive was asked to lead; before the first nobody knows."""
    here, events = "", []
    for event in trace:
        events.append(replace(event, place=here))
        here = event.text if event.kind == "goto" else here
    return tuple(events)


def search(rows: Iterable[bytes], question: Question, *, workers: int = 1) -> Iterator[Found]:
    """Look through the rows of an evaluation, in their order.

    Args:
        rows: lines of an evaluation's file.
        question: what is looked for.
        workers: how many processes look.

    Raises:
        RtlSyntaxError: the formula is none.
        BadInput: a line is no row of an evaluation; its `line` says which, counted from 1.
    """
    formula = None if question.formula is None else parse(question.formula)
    lines = iter(rows)
    first = list(islice(lines, BATCH * SMALL))
    if workers == 1 or len(first) < BATCH * SMALL:
        for number, line in enumerate(chain(first, lines), 1):
            yield _looked(number, line, question, formula)
        return
    # Other processes are started anew: this one may have threads, which a fork would break.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context) as pool:
        waiting: deque[Future[list[Found]]] = deque()
        batches = _batches(chain(first, lines))
        for count, batch in enumerate(batches):
            waiting.append(pool.submit(look_through, count * BATCH + 1, batch, question))
            if len(waiting) > 4 * workers:
                yield from waiting.popleft().result()
        while waiting:
            yield from waiting.popleft().result()


def _batches(lines: Iterator[bytes]) -> Iterator[list[bytes]]:
    while batch := list(islice(lines, BATCH)):
        yield batch


def look_through(start: int, lines: list[bytes], question: Question) -> list[Found]:
    """What some rows say, of which the first has a number; the work of one process."""
    formula = None if question.formula is None else parse(question.formula)
    return [_looked(number, line, question, formula) for number, line in enumerate(lines, start)]


def _looked(number: int, line: bytes, question: Question, formula: Formula | None) -> Found:
    try:
        return asked_of(row_of(json.loads(line)), question, formula)
    except BadInput as error:
        raise BadInput(error.sentence, line=number) from None
    except (ValueError, RecursionError):
        raise BadInput(NO_ROW, line=number) from None


def found_view(found: Sequence[Found], total: int) -> RenderableType:
    """How many completions were found, by task, for a person.

    Args:
        found: those that do what was looked for.
        total: how many were looked at.
    """
    head = Text(f"found {len(found):,} of {how_many(total)}", "bold")
    if not found:
        return head
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    table.add_column("task", overflow="fold")
    for name in ("found", "passed", "such as"):
        table.add_column(name, justify="right" if name != "such as" else "left")
    by_task: dict[str, list[Found]] = {}
    for one in found:
        by_task.setdefault(one.key[0], []).append(one)
    for task, those in by_task.items():
        passed = sum(one.passed for one in those)
        example = f"{name_of(those[0].key)}, world {those[0].worlds[0][0]}"
        table.add_row(Text(visible(task)), f"{len(those):,}", f"{passed:,}", Text(visible(example), "dim"))
    return Group(head, Text(), table)
