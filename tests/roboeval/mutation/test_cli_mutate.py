"""The command `roboeval mutate`."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from command_line import ENVIRONMENT, Ended, refused, roboeval
from small_suite import write_suite

WIDE = {**ENVIRONMENT, "COLUMNS": "160"}
LINE = re.compile(r"^(\w+) +(\d+) +(\d+) +(\d+) +(\d+) +0 +(\d+)  ([01]\.\d{3}) .*\d$", re.MULTILINE)
GREETS = """\
def task_program():
    for r in get_all_rooms():
        if "lab" in r:
            go_to(r)
            if is_in_room("person"):
                say("good day")
"""


def mutate(*words: str | Path, cwd: Path, workers: int = 2) -> Ended:
    return roboeval("mutate", *words, "--mutants", "60", "--workers", str(workers), cwd=cwd, environment=WIDE)


def rows_of(folder: Path, task: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "mutants" / f"{task}.jsonl").read_text().splitlines()]


@pytest.mark.slow
def test_two_tasks_from_end_to_end(tmp_path: Path) -> None:
    ended = mutate("SayGoodDay", "GetDrink", "--out", "found", cwd=tmp_path)
    assert ended.status == 0, ended
    found = tmp_path / "found"
    scores = json.loads((found / "scores.json").read_text())["tasks"]
    lines = LINE.findall(ended.out)
    assert [line[0] for line in lines] == ["SayGoodDay", "GetDrink"]
    for score, (task, worlds, originals, mutants, killed, survived, rate) in zip(scores, lines, strict=True):
        rows = rows_of(found, task)
        assert len({row["program"] for row in rows}) == len(rows) == 60
        statuses = [row["status"] for row in rows]
        assert (statuses.count("killed"), statuses.count("survived")) == (int(killed), int(survived))
        assert int(mutants) == int(killed) + int(survived)
        assert (score["worlds"], score["originals"]) == (int(worlds), int(originals))
        assert float(rate) == round(int(killed) / int(mutants), 3)
        survivors = [(row["operator"], row["diff"]) for row in rows if row["status"] == "survived"]
        listed = yaml.safe_load((found / "survivors" / f"{task}.yaml").read_text())["equivalent_mutants"]
        assert [(entry["operator"], entry["diff"]) for entry in listed] == survivors
        assert len(re.findall(rf"^{task} \d+  ", ended.out, re.MULTILINE)) == int(survived)
        for _, diff in survivors:
            assert diff.splitlines()[-1] in ended.out
    assert ended.err.splitlines()[-1].endswith("in found")


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """Write a suite with one task, two correct programs, and two wrong ones."""
    (tmp_path / "small").mkdir()
    own = Path(write_suite(tmp_path / "small"))
    bodies = {
        "goes": "go_to('kitchen')",
        "broken": "go_to('kitchen'",
        "idle": "pass",
        "greets": "go_to('kitchen'); say('hello')",
    }
    programs = [
        {"about": about, "program": f"def task_program(): {body}\n"} for about, body in bodies.items()
    ]
    (own / "solutions").mkdir()
    (own / "solutions" / "T.yaml").write_text(yaml.safe_dump({"programs": programs}))
    return own


@pytest.mark.slow
def test_the_number_of_workers_does_not_change_the_bytes(tmp_path: Path) -> None:
    first, second = (
        mutate("SayGoodDay", "--out", f"out{workers}", cwd=tmp_path, workers=workers) for workers in (1, 3)
    )
    assert first.out == second.out
    files = [path.relative_to(tmp_path / "out1") for path in (tmp_path / "out1").rglob("*.*")]
    assert len(files) == 3
    for file in files:
        assert (tmp_path / "out1" / file).read_bytes() == (tmp_path / "out3" / file).read_bytes()


def test_another_seed_samples_other_mutants(small: Path) -> None:
    for seed in ("1", "2"):
        words = ("--suite", small, "--mutants", "3", "--seed", seed, "--out", small / seed)
        assert roboeval("mutate", *words, "--workers", "1").status == 0
    one, two = ({row["program"] for row in rows_of(small / seed, "T")} for seed in ("1", "2"))
    assert len(one) == len(two) == 3
    assert one != two


def test_brief_output_has_no_survivors(small: Path) -> None:
    brief, whole = (mutate("--suite", small, *words, cwd=small) for words in (["--brief"], []))
    assert whole.out.startswith(brief.out)
    assert "@@" not in brief.out
    assert "T 1  " in whole.out
    assert "-    say('hello')" in whole.out


@pytest.mark.slow
def test_programs_that_a_user_names_are_mutated(tmp_path: Path) -> None:
    programs = [
        GREETS,
        GREETS.replace("good day", "a good day"),
        "def task_program(:\n",
        "def task_program(): pass",
    ]
    rows = [{"task": "SayGoodDay", "prompt": 0, "index": n, "program": p} for n, p in enumerate(programs)]
    (tmp_path / "mine.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    ended = mutate("SayGoodDay", "--brief", "--also", "mine.jsonl", "--out", "found", cwd=tmp_path)
    assert ended.status == 0, ended
    (score,) = json.loads((tmp_path / "found" / "scores.json").read_text())["tasks"]
    wrong = [(one["original"], one["why"]) for one in score["originals_judged_wrong"]]
    assert wrong == [
        ("mine.jsonl:SayGoodDay/0/2", "SyntaxError"),
        ("mine.jsonl:SayGoodDay/0/3", "visits_every_lab"),
    ]
    assert "mine.jsonl" not in ended.err
    mutated = {row["original"] for row in rows_of(tmp_path / "found", "SayGoodDay")}
    assert "mine.jsonl:SayGoodDay/0/1" in mutated


def test_solutions_that_the_suite_judges_wrong_are_not_mutated(small: Path) -> None:
    ended = mutate("--suite", small, "--brief", cwd=small)
    assert ended.status == 0, ended
    assert re.findall(r"^not mutated .*: (T, .*)$", ended.err, re.MULTILINE) == [
        "T, broken (one: SyntaxError)",
        "T, idle (one: goes)",
    ]
    assert re.search(r"^warning: T: .*\b\d mutants", ended.err, re.MULTILINE)


def test_a_score_that_is_too_low_fails(small: Path) -> None:
    assert mutate("--suite", small, "--brief", "--at-least", "0.1", cwd=small).status == 0
    assert mutate("--suite", small, "--brief", "--at-least", "0.999", cwd=small).status == 1


def test_an_equivalent_mutant_is_not_shown_again(small: Path) -> None:
    words = ("--suite", small, "--out", small / "found")
    assert mutate(*words, cwd=small).status == 0
    survivors = (small / "found" / "survivors" / "T.yaml").read_text()
    with (small / "solutions" / "T.yaml").open("a") as solutions:
        solutions.write(survivors.replace("because: ''", "because: It may."))
    ended = mutate(*words, cwd=small)
    (score,) = json.loads((small / "found" / "scores.json").read_text())["tasks"]
    assert (score["survived"], score["score"]) == (0, 1.0)
    assert score["score_of_all"] == score["killed"] / (score["killed"] + score["equivalent"]) < 1
    assert not (small / "found" / "survivors" / "T.yaml").exists()
    assert re.search(r"\bmutants\b.*\b15%", ended.err)
    assert "@@" not in ended.out


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("SayGoodNight",), ['"paper"', '"SayGoodNight"']),
        (("SayGoodDay", "--worlds", "200"), ["worlds", '"paper"', "by hand"]),
        (("SayGoodDay", "--suite", "plus", "--worlds", "1000000000"), ["invalid value", "'--worlds'"]),
        (("SayGoodDay", "--out", ""), ["empty", "a folder"]),
        (("SayGoodDay", "--suite", "nowhere"), ['"nowhere"']),
    ],
)
def test_wrong_options_are_refused(words: tuple[str, ...], named: list[str], tmp_path: Path) -> None:
    refusal = refused("mutate", *words, cwd=tmp_path)
    assert all(name in refusal.sentence for name in named), refusal
    assert not list(tmp_path.iterdir())


def test_missing_programs_are_refused(tmp_path: Path) -> None:
    refusal = refused("mutate", "SayGoodDay", "--also", "no.jsonl", cwd=tmp_path)
    assert refusal.at == ("no.jsonl", None)
    assert "does not exist" in refusal.sentence
    assert not list(tmp_path.iterdir())
