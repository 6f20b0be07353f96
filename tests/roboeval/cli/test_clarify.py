"""`roboeval clarify` prints a table, or JSON for machines."""

import csv
import json
from pathlib import Path

import pytest

from command_line import refused, roboeval

GREETS = 'def task_program():\n    say("good day")\n'
SILENT = "def task_program():\n    pass\n"


@pytest.fixture
def source(tmp_path: Path) -> Path:
    rows = [
        {"task": "SayGoodDay", "prompt": prompt, "index": index, "program": (GREETS, SILENT)[index % 2]}
        for prompt in (0, 1)
        for index in range(4)
    ]
    path = tmp_path / "completions.jsonl"
    path.write_text("".join(f"{json.dumps(row)}\n" for row in rows))
    return path


@pytest.mark.slow
def test_json_has_the_shares_overall_and_for_each_prompt(source: Path) -> None:
    ended = roboeval("clarify", source, "--candidates", "4", "--workers", "1", "--json")
    assert ended.status == 0
    data = json.loads(ended.out)
    names = {"one", "majority", "question", "asked", "mattered"}
    assert names <= data.keys()
    assert [(one["task"], one["prompt"]) for one in data["prompts"]] == [("SayGoodDay", 0), ("SayGoodDay", 1)]
    assert all(names <= one.keys() for one in data["prompts"])
    assert (data["asked"], data["candidates"], data["noise"], data["seed"]) == (1.0, 4, 0.0, 0)


@pytest.mark.slow
def test_the_table_has_a_row_for_each_prompt(source: Path) -> None:
    ended = roboeval("clarify", source, "--candidates", "4", "--workers", "1")
    assert ended.status == 0
    assert ended.out.count("SayGoodDay") == 2


@pytest.mark.slow
def test_a_run_keeps_the_result_for_the_report(source: Path, tmp_path: Path) -> None:
    suite = ("--suite", "plus")
    judged = roboeval("evaluate", source, *suite, "--worlds", "31", "--out", "run", cwd=tmp_path)
    assert judged.status == 0, judged
    rules = tmp_path / "rules.yaml"
    rules.write_text('rules:\n  - name: hush\n    says: Be quiet.\n    always: not tr.Exists(say(".*"))\n')
    asked = ("clarify", "run", *suite, "--candidates", "4", "--workers", "1", "--json")
    assert roboeval(*asked, "--rules", rules, cwd=tmp_path).status == 0
    assert not (tmp_path / "run" / "clarify").exists()
    ended = roboeval(*asked, cwd=tmp_path)
    (kept,) = (tmp_path / "run" / "clarify" / "plus").iterdir()
    assert json.loads(kept.read_text()) == json.loads(ended.out)
    made = roboeval("report", "run", *suite, "--no-check", "--out", "report", cwd=tmp_path)
    assert made.status == 0, made
    with (tmp_path / "report" / "tables" / "question-prompts.csv").open(newline="") as file:
        rows = [*csv.DictReader(file)]
    assert [(row["task"], row["prompt"], row["asked"]) for row in rows] == [
        *(("SayGoodDay", str(prompt), "1.0") for prompt in (0, 1))
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("counts", "candidates", "judged"), [((4, 2, 2), 2, 3), ((4, 4, 1), 4, 2)])
def test_by_default_half_of_the_prompts_are_measured(
    tmp_path: Path, counts: tuple[int, ...], candidates: int, judged: int
) -> None:
    path = tmp_path / "completions.jsonl"
    rows = [
        {"task": "SayGoodDay", "prompt": prompt, "index": index, "program": GREETS}
        for prompt, count in enumerate(counts)
        for index in range(count)
    ]
    path.write_text("".join(f"{json.dumps(row)}\n" for row in rows))
    ended = roboeval("clarify", path, "--workers", "1")
    assert f"{candidates} candidates" in " ".join(ended.out.split())
    assert ended.out.count("SayGoodDay") == judged
    assert ("2 of 3 prompts" in " ".join(ended.out.split())) is (judged < len(counts))


def test_too_few_completions_are_refused(source: Path) -> None:
    assert "--candidates" in refused("clarify", source, "--candidates", "10", "--workers", "1").sentence
