"""Questions of a careful reader: returns, phrasings, prices, differences and groups of failures."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.errors import UserError
from made_up_runs import SUITE, new_run, usual
from roboeval.evaluation.clarify import (
    ClarifySettings,
    PromptShares,
    measurement_data,
    store_measurement,
)
from roboeval.evaluation.runs.table import Price
from roboeval.report.runs import JudgedRun, price_runs, read_prices
from roboeval.report.sections.breakdown import (
    ability_sheet,
    distinct_words,
    phrasing_sheet,
    report_back_sheet,
    spread_sheet,
)
from roboeval.report.sections.cost import budget_sheet, cost_sheet
from roboeval.report.sections.failures import failures_section
from roboeval.report.sections.question import question_section
from roboeval.report.sections.scores import differences_section
from roboeval.report.sheets import Groups, Prose, Sheet
from roboeval.report.writing import about_suite, origin_sheet

ABLE = replace(
    SUITE,
    tasks={
        "Visit": replace(SUITE.tasks["Visit"], abilities=("navigation", "report-back")),
        "FindBook": replace(SUITE.tasks["FindBook"], abilities=("navigation",)),
    },
)


def as_dicts(table: Sheet) -> list[dict[str, Any]]:
    return [dict(zip((c.head for c in table.columns), row, strict=True)) for row in table.rows]


# --- abilities


def test_abilities_of_several_runs_are_in_one_table() -> None:
    runs = [new_run(name, {"Visit": (10, 4), "FindBook": (0,)}, suite=ABLE) for name in "ab"]
    found = as_dicts(ability_sheet(runs))
    assert [(row["ability"], row["model"]) for row in found] == [
        *(("navigation", "a"), ("navigation", "b"), ("report-back", "a"), ("report-back", "b"))
    ]
    classes = {"Python errors", "robot errors", "failed checks"}
    assert sum(found[0][name] for name in classes) == pytest.approx(16 / 30)
    assert found[2]["pass@1"] == pytest.approx(0.7)
    assert ability_sheet(usual()).rows == []


def test_returns_are_counted() -> None:
    run = new_run("a", {"Visit": (3,), "FindBook": (2,)}, suite=ABLE)
    table = report_back_sheet([run])
    with_report, others = as_dicts(table)
    assert (with_report["failed"], with_report["never returned"], with_report["no such room"]) == (7, 0, 1)
    assert with_report["share no such room"] == pytest.approx(1 / 7)
    assert (others["tasks"], others["completions"]) == ("others", 10)
    assert report_back_sheet(usual()).rows == []


def test_without_failures_the_share_of_returns_is_unknown() -> None:
    table = report_back_sheet([new_run("a", {"Visit": (10,)}, suite=ABLE)])
    assert as_dicts(table)[0]["share never returned"] is None


# --- phrasing


def run_with_instructions(instructions: Sequence[str]) -> JudgedRun:
    return new_run("a", {"Visit": (9, 2)}, written=lambda prompt, _: {"instruction": instructions[prompt]})


def test_the_spread_and_the_words_that_differ() -> None:
    run = run_with_instructions(["Ask him what's there.", "Inquire of him, what's there?"])
    (found,) = as_dicts(spread_sheet([run]))
    assert found["spread"] == pytest.approx(0.7)
    assert (found["worst prompt"], found["best prompt"]) == (1, 0)
    assert (found["words of the worst only"], found["words of the best only"]) == ("inquire of", "ask")


def test_distinct_words_of_unrecorded_and_long_instructions() -> None:
    assert distinct_words(None, "a") == ("instruction not recorded",) * 2
    assert distinct_words("a a b", "b") == ("a", "")
    assert distinct_words(" ".join(map(str, range(20))), "")[0].endswith("11 and 8 more")


def test_phrasings_are_ranked_by_their_effect() -> None:
    runs = [
        run_with_instructions(["one", "two"]),
        run_with_instructions(["one", "three"]),
        new_run("b", {"Visit": (6, 2), "FindBook": (1,)}),
    ]
    worst, best = as_dicts(phrasing_sheet(runs))
    assert (worst["prompt"], worst["instruction"]) == (1, "three / two")
    assert worst["beside its task"] == pytest.approx(-0.9 / 3)
    assert (worst["hurts"], worst["of models"]) == (3, 3)
    assert (best["beside its task"], best["instruction"]) == (pytest.approx(0.9 / 3), "one")
    (row, _) = as_dicts(phrasing_sheet(runs[2:]))
    assert row["instruction"] == "instruction not recorded"


# --- cost


def test_costs_are_of_runs_that_count_tokens() -> None:
    usage = {"usage": {"input_tokens": 1_000, "output_tokens": 500}}
    runs = [new_run("a", {"Visit": (4,)}, written=lambda *_: usage), new_run("b", {"Visit": (4,)})]
    runs = price_runs(runs, {"a": Price(10.0, 20.0)})
    (found,) = as_dicts(cost_sheet(runs))
    assert (found["model"], found["input tokens"], found["seconds"]) == ("a", 10_000, None)
    assert found["money per pass"] == pytest.approx(0.05)
    budget = as_dicts(budget_sheet(runs))
    assert [(row["model"], row["retries"]) for row in budget[::5]] == [("a", 0), ("b", 0)]
    assert (budget[0]["passes per unit of money"], budget[5]["passes per unit of money"]) == (
        pytest.approx(0.4 / 0.02),
        None,
    )
    assert cost_sheet(runs[1:]).rows == []


def test_prices_are_read_and_checked() -> None:
    prices = read_prices(["openai-chat:gpt=1.5/6", "b=0/0"])
    assert prices == {"openai-chat:gpt": Price(1.5, 6.0), "b": Price(0.0, 0.0)}
    for wrong in ("gpt", "gpt=1", "=1/2", "gpt=a/b", "gpt=-1/2", "gpt=nan/1", "gpt=1/2/3"):
        with pytest.raises(UserError, match="INPUT/OUTPUT"):
            read_prices([wrong])
    with pytest.raises(UserError, match=r'--price .*"x".*\ba$'):
        price_runs([new_run("a", {"Visit": (1,)})], {"x": Price(1, 1)})


def test_a_price_for_a_folder_overrides_that_for_its_model() -> None:
    run = new_run("a", {"Visit": (1,)}, folder="cheap")
    for prices, of_run in (
        ({"a": Price(2, 2), "cheap": Price(1, 1)}, Price(1, 1)),
        ({"a": Price(2, 2)}, Price(2, 2)),
        ({}, None),
    ):
        assert [one.price for one in price_runs([run], prices)] == [of_run]


# --- differences, groups and origins


def test_differences_are_of_all_pairs_or_with_the_best() -> None:
    said, table = differences_section(usual()).parts
    assert isinstance(said, Prose)
    assert isinstance(table, Sheet)
    assert [row[0] for row in table.rows] == ["middle minus strong", "weak minus strong", "weak minus middle"]
    assert len(said.paragraphs) == 3
    assert differences_section(usual()[:1]).parts == []
    _, table = differences_section([new_run(f"m{n}", {"Visit": (n,)}) for n in range(8)]).parts
    assert isinstance(table, Sheet)
    assert {row[0].split(" minus ")[0] for row in table.rows} == {"m7"}
    assert differences_section([new_run("a", {"Visit": (1,)}), new_run("b", {"FindBook": (1,)})]).parts == []


def test_pairs_with_different_settings_have_a_note() -> None:
    one, other = (
        new_run(name, {"Visit": (n,)}, about={"settings": {"temperature": n}}) for n, name in enumerate("ab")
    )
    _, table = differences_section([one, other]).parts
    assert isinstance(table, Sheet)
    _, note = table.notes
    assert re.search(r"^a and b: temperature\b.* 0 and 1", note)


def test_the_number_of_shown_groups_is_limited_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    run = new_run("a", {"Visit": (3,)})
    _, groups, table = failures_section([run]).parts
    assert isinstance(groups, Groups)
    assert sum(len(one.members) for _, one in groups.shown) == 7
    assert isinstance(table, Sheet)
    rows = as_dicts(table)
    assert (rows[0]["passes"], rows[0]["lines apart"]) == ("Visit/0/0", 0)
    monkeypatch.setattr("roboeval.report.sections.failures.MAX_GROUPS_PER_RUN", 2)
    monkeypatch.setattr("roboeval.report.sections.failures.MIN_GROUPS_PER_RUN", 2)
    about, groups, table = failures_section([run]).parts
    assert isinstance(about, Prose)
    assert re.search(r"^a: 2 of 7 groups are shown", about.paragraphs[-1])
    assert isinstance(groups, Groups)
    assert len(groups.shown) == 2
    assert isinstance(table, Sheet)
    assert as_dicts(table) == rows
    assert failures_section([new_run("a", {"Visit": (10,)})]).parts == []


def test_the_origin_of_a_run_is_listed() -> None:
    run = new_run("a", {"Visit": (3,)}, about={"settings": {"temperature": 0.2, "seed": None}})
    (found,) = as_dicts(origin_sheet([run]))
    assert found["settings"] == "temperature 0.2, seed null"
    assert found["suite hash"] == SUITE.digest
    assert found["prompt template"] == "not recorded"
    assert SUITE.digest in about_suite([run])[0]


# --- one question


def test_gains_of_a_question_by_run_and_by_prompt(tmp_path: Path) -> None:
    measured, plain = new_run("a", {"Visit": (5, 5)}, folder=str(tmp_path), key="small"), new_run("b", {})
    silent: PromptShares = {
        "task": "Visit", "prompt": 1, "one": 0.5, "majority": 0, "question": 0, "asked": 0,
        "mattered": None, "tokens": None,
    }  # fmt: skip
    prompts: list[PromptShares] = [
        {**silent, "prompt": 0, "question": 0.5, "asked": 0.5, "mattered": 1, "tokens": 30},
        silent,
    ]
    data = measurement_data(measured.results.completions.values(), SUITE, ClarifySettings(3, 0.1, 7), prompts)
    store_measurement(measured.results.run, SUITE, data)
    by_run, by_prompt = question_section([measured, plain]).parts
    assert isinstance(by_run, Sheet)
    assert as_dicts(by_run) == [
        {
            "model": "a",
            "candidates": 3,
            "one program": 0.5,
            "majority": 0.0,
            "one question": 0.25,
            "asked": 0.25,
            "mattered": 1.0,
            "noise": 0.1,
            "tokens per group": 30,
            "seed": 7,
            "prompts": 2,
        }
    ]
    assert isinstance(by_prompt, Sheet)
    first, second = as_dicts(by_prompt)
    assert (first["prompt"], first["one question"], first["asked"], first["mattered"]) == (0, 0.5, 0.5, 1.0)
    assert (second["prompt"], second["one question"], second["mattered"]) == (1, 0.0, None)
    assert [first[name] for name in ("task", "model", "candidates", "noise", "seed")] == [
        *("Visit", "a", 3, 0.1, 7)
    ]
    assert question_section([plain]).parts == []
    store_measurement(measured.results.run, SUITE, {**data, "digest": "other"})
    (outdated,) = question_section([measured, plain]).parts
    assert isinstance(outdated, Prose)
    assert [words.partition(":")[0] for words in outdated.paragraphs] == ["a"]
