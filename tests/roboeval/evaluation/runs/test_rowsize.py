"""Rows of an evaluation have a maximum size; shorter ones stay whole."""

from __future__ import annotations

import hashlib
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from codebotler.core.files import to_line
from codebotler.core.trace import Event, Outcome, RunError, Status, Trace
from codebotler.core.world import Room, World
from codebotler.rtl import parse
from made_results import row_of, table_of
from roboeval.analysis.search import TraceQuery, search_row
from roboeval.cli.views.completions import completion_view
from roboeval.evaluation.judging.explanation import completion_data
from roboeval.evaluation.judging.failures import Verdict
from roboeval.evaluation.judging.serialization import ROW_BYTES, WORLD_BYTES, judgement
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.rows import Row
from roboeval.evaluation.runs.traces import CIRCUMSTANCES, trace_of
from roboeval.suites.load import Suite, load_suite

WORLD = World(rooms=(Room("start"),), robot="start", about="nobody is in")
LOUD = (Event("goto", "start"), *[Event("say", "\x00\x1b" * 4_999)] * 98)
WRITTEN = Completion(task="T", prompt=0, index=0, program="x = 1")
WORDY = Completion(task="T" * 250, prompt=999_999_999, index=999_999_999, program="x = 1")


def row(traces: list[Trace], message: str = "no", completion: Completion = WORDY) -> Row:
    error = RunError("K" * 100, message)
    outcomes = [Outcome(Status.PYTHON_ERROR, trace, error, 1) for trace in traces]
    verdicts = [Verdict(f"World {n}", outcome, (), satisfied=False) for n, outcome in enumerate(outcomes)]
    return row_of(completion, judgement(verdicts))


@pytest.mark.slow
@pytest.mark.parametrize(("worlds", "most"), [(1, ROW_BYTES), (50, ROW_BYTES), (80, 80 * WORLD_BYTES)])
def test_a_row_is_bounded_whatever_its_program_says(worlds: int, most: int) -> None:
    one = row([LOUD[:20]] * worlds, "\x00" * 1_000)
    line = to_line(one)
    assert 0.5 * most - 70_000 * worlds < len(line) <= most
    whole = to_line([[e.kind, e.text] for e in LOUD[:20]])[:-1]
    for verdict in one["verdicts"]:
        assert verdict["cut"] == {
            "events": 20 - len(verdict["trace"]),
            "sha256": hashlib.sha256(whole).hexdigest(),
        }
        assert verdict["trace"][0] == ["goto", "start"]
        assert verdict["error"] is not None
        assert (verdict["error"]["message"], verdict["line"]) == ("\x00" * 1_000, 1)
    assert to_line(row([LOUD[:20]] * worlds, "\x00" * 1_000)) == line


def test_circumstances_are_bounded_with_their_events() -> None:
    rooms = [f"room {n} " + "x" * 300 for n in range(1_000)]
    drives = [
        Event("goto", "x", place=here, holding="y" * (n % 2), to=f"{n} " + "z" * 900, destination=there)
        for n, (here, there) in enumerate(pairwise(rooms))
    ]
    one = row([tuple(drives), LOUD])
    assert 0.5 * ROW_BYTES < len(to_line(one)) <= ROW_BYTES
    first, second = one["verdicts"]
    kept = trace_of(first)
    assert 0 < len(kept) < len(drives)
    assert first["cut"]["events"] == len(drives) - len(kept)
    assert [(e.place, e.holding, e.to, e.destination) for e in kept] == [
        (e.place, e.holding, e.to, e.destination) for e in drives[: len(kept)]
    ]
    entries: dict[str, Any] = {**first}
    assert max(n for name in CIRCUMSTANCES[1:] for n, _ in entries.get(name, [(0, "")])) <= len(kept)
    assert trace_of(second)[1].place == ""


def test_a_row_that_fits_stays_whole() -> None:
    short = (Event("say", "x" * 2_000),) * 8
    one = row([short] * 50)
    assert len(to_line(one)) > 0.8 * ROW_BYTES
    assert not any("cut" in verdict for verdict in one["verdicts"])
    mixed = row([LOUD, short])["verdicts"]
    assert "cut" in mixed[0]
    assert "cut" not in mixed[1]


@pytest.fixture(scope="module")
def suite(tmp_path_factory: pytest.TempPathFactory) -> Suite:
    folder: Path = tmp_path_factory.mktemp("suite")
    (folder / "suite.yaml").write_text("name: mine\nversion: 1\n")
    (folder / "tasks").mkdir()
    (folder / "tasks" / "T.yaml").write_text(
        "name: T\nsummary: s\nprompts: [p]\n"
        "checks:\n  says: {category: Location, rtl: 'tr.Exists(say(\"bye\"))'}\n"
        "worlds:\n"
        + "".join(
            f"  - {{about: World {n}, robot: start, rooms: [start], require: [says]}}\n" for n in (0, 1)
        )
    )
    return load_suite(folder)


def cut_row(suite: Suite) -> Row:
    scenarios = suite.tasks["T"].scenarios
    ended = [Outcome(Status.FINISHED, LOUD), Outcome(Status.FINISHED, LOUD[:1])]
    verdicts = [
        Verdict(s.world.about, o, s.require, satisfied=False) for s, o in zip(scenarios, ended, strict=True)
    ]
    return row_of(WRITTEN, judgement(verdicts))


def test_a_cut_trace_is_marked_and_not_explained(suite: Suite) -> None:
    one = cut_row(suite)
    first, second = completion_data(one, WRITTEN, suite)["worlds"]
    assert first["cut"] == one["verdicts"][0]["cut"]
    assert "cut" not in second
    assert "too long" in first["failed_checks"][0]["explanation"]
    assert "never said" in second["failed_checks"][0]["explanation"]
    console = Console(width=100)
    with console.capture() as shown:
        console.print(completion_view(completion_data(one, WRITTEN, suite)))
    assert f"{first['cut']['events']} more steps" in shown.get()


def test_a_table_counts_all_events_of_a_cut_trace(suite: Suite) -> None:
    assert table_of([cut_row(suite)]).get_column("events").to_list() == [99, 1]


@pytest.mark.parametrize("negated", [False, True])
def test_a_formula_is_undecided_where_the_trace_was_cut(suite: Suite, *, negated: bool) -> None:
    formula = 'tr.Exists(say("bye"))'
    found = search_row(cut_row(suite), TraceQuery(parse(formula), negated))
    assert found.cut == ((1, "World 0"),)
    assert found.worlds == (((2, "World 1"),) if negated else ())
    assert len(search_row(cut_row(suite), TraceQuery()).worlds) == 2
