"""Every reader notices damage in an evaluation and refuses unknown values."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.errors import UserError
from codebotler.core.files import to_line
from roboeval.evaluation.evaluate import evaluate_run
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.evaluation.runs.results import Results, read_results
from roboeval.evaluation.runs.rows import Row, key_of
from roboeval.suites.load import Suite
from seals import unseal

PLACES = 60
Parts = tuple[Any, ...]


def write_completions(run: RunFolder, count: int) -> None:
    rows = (
        {"task": "LunchTime", "prompt": 0, "index": n, "program": f"go_to('office {n}')\nsay('Hi!')\n"}
        for n in range(count)
    )
    run.completions.write_bytes(b"".join(map(to_line, rows)))


def judge_run(run: RunFolder, suite: Suite) -> list[Row]:
    return list(evaluate_run(run, suite, ablated=False, tasks=None, redo=False))


def read(run: RunFolder, **how: Any) -> Results:  # noqa: ANN401 - the options of read_results
    return read_results(run, "paper", **how)


@pytest.fixture(scope="module")
def finished_run(tmp_path_factory: pytest.TempPathFactory, paper: Suite) -> RunFolder:
    run = RunFolder(tmp_path_factory.mktemp("run"))
    write_completions(run, 3)
    judge_run(run, paper)
    return run


@pytest.fixture
def run(finished_run: RunFolder, tmp_path: Path) -> RunFolder:
    again = RunFolder(tmp_path / "run")
    for path in (finished_run.completions, *finished_run.rows("").parent.iterdir()):
        copy = again.path / path.relative_to(finished_run.path)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
    return again


def manifest(run: RunFolder) -> dict[str, Any]:
    return json.loads(run.manifest("paper").read_text())  # type: ignore[no-any-return]  # JSON has no types


def test_a_finished_evaluation_records_the_count_and_the_hash_of_its_rows(run: RunFolder) -> None:
    content = run.rows("paper").read_bytes()
    assert (manifest(run)["rows"], manifest(run)["sha256"]) == (3, hashlib.sha256(content).hexdigest())
    assert len(read(run).places) == 3


def test_only_the_rows_of_a_named_task_are_read(run: RunFolder) -> None:
    found = read(run, task="LunchTime")
    assert [key_of(found.row(key)) for key in found.places] == [*found.places]
    assert len(found.places) == 3
    others = read(run, task="SayGoodDay")
    assert (len(others.table), others.places) == (0, {})


@pytest.mark.parametrize("content", [b"", b"another row\n" * 500])
def test_rows_of_a_replaced_file_are_refused(run: RunFolder, content: bytes) -> None:
    found = read(run)
    run.rows("paper").write_bytes(content)
    for key in found.places:
        with pytest.raises(UserError, match="replaced"):
            found.row(key)


def test_every_flipped_bit_is_noticed(run: RunFolder, paper: Suite) -> None:
    path = run.rows("paper")
    content = path.read_bytes()
    readers: dict[str, Callable[[], object]] = {
        "results": lambda: read(run),
        "another task": lambda: read(run, task="SayGoodDay"),
        "evaluate": lambda: judge_run(run, paper),
    }
    for number in range(PLACES):
        flipped = bytearray(content)
        flipped[number * (len(content) - 1) // (PLACES - 1)] ^= 1 << number % 8
        for name, reading in readers.items():
            path.write_bytes(flipped)
            with pytest.raises(UserError) as caught:
                reading()
            assert caught.value.file == path, (number, name)
            assert "--redo" in caught.value.sentence


@pytest.mark.parametrize(
    "damaged", ['{"tosk": "LunchTime"}', '{"task": "LunchTime", "program_sha256": 1}', "{"]
)
def test_a_damaged_check_is_named_by_its_line(run: RunFolder, damaged: str) -> None:
    checks = run.checks("paper")
    checks.parent.mkdir()
    row = {"task": "LunchTime", "program_sha256": "0", "problems": []}
    checks.write_bytes(to_line(row) + damaged.encode() + b"\n")
    with pytest.raises(UserError) as caught:
        read(run)
    assert (caught.value.file, caught.value.line) == (checks, 2)


def test_missing_and_additional_rows_are_noticed(run: RunFolder) -> None:
    lines = run.rows("paper").read_bytes().splitlines(keepends=True)
    for damaged in (lines[:2], [*lines, lines[0]], [*lines, b'{"torn'], [lines[1], lines[0], lines[2]]):
        run.rows("paper").write_bytes(b"".join(damaged))
        with pytest.raises(UserError, match="--redo"):
            read(run)


def test_an_evaluation_of_an_earlier_version_is_read_and_gets_its_seal(run: RunFolder, paper: Suite) -> None:
    sealed = run.manifest("paper").read_bytes()
    unseal(run.path)
    assert len(read(run).places) == 3
    judge_run(run, paper)
    assert run.manifest("paper").read_bytes() == sealed


def test_continuing_removes_the_seal_until_all_is_judged(run: RunFolder, paper: Suite) -> None:
    write_completions(run, 5)
    rows = evaluate_run(run, paper, ablated=False, tasks=None, redo=False)
    assert [next(rows)["index"] for _ in range(4)] == [0, 1, 2, 3]
    rows.close()  # type: ignore[attr-defined]  # The rows are a generator.
    assert not {"rows", "sha256"} & manifest(run).keys()
    assert len(read(run).places) == 4
    judge_run(run, paper)
    content = run.rows("paper").read_bytes()
    assert (manifest(run)["rows"], manifest(run)["sha256"]) == (5, hashlib.sha256(content).hexdigest())


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("more",), 1),
        (("failure", "more"), 1),
        (("failure", "world"), 2),
        (("passed",), True),
        (("verdicts", 1, "more"), 1),
        (("verdicts", 1, "status"), "finishee"),
        (("verdicts", 1, "trace"), [["goto", "lab"], []]),
        (("verdicts", 1, "cut"), {"events": 1}),
    ],
)
def test_an_unknown_field_or_value_is_refused_with_its_line(
    run: RunFolder, place: Parts, value: object
) -> None:
    rows = [json.loads(line) for line in run.rows("paper").read_bytes().splitlines()]
    inner = rows[1]
    for part in place[:-1]:
        inner = inner[part]
    inner[place[-1]] = value
    run.rows("paper").write_bytes(b"".join(map(to_line, rows)))
    unseal(run.path)
    with pytest.raises(UserError) as caught:
        read(run)
    assert (caught.value.file, caught.value.line) == (run.rows("paper"), 2)
