"""What a careful reader asks: abilities, coming back, phrasing, cost, differences, groups of failures."""

import re
from dataclasses import replace
from typing import Any

import pytest

from codebotler.badinput import BadInput
from codebotler.world import Room, World
from made_up_runs import SUITE, made_up, usual
from roboeval.analysis.resample import Prompt, Trial
from roboeval.evaluation.completions import Completion
from roboeval.report.cost import (
    Price,
    budget_sheet,
    cost_sheet,
    expect_known,
    price_from,
    price_of,
    requests,
    spent,
)
from roboeval.report.differences import difference_sheet
from roboeval.report.failures import failures, failures_sheet
from roboeval.report.origin import about_suite, origin_sheet
from roboeval.report.reading import JudgedRun, Written, _written
from roboeval.report.robustness import only, phrasing_sheet, spread_sheet
from roboeval.report.sheets import Sheet
from roboeval.report.strengths import ability_sheet, coming_back_said, coming_back_sheet, never_returned
from roboeval.suites.load import Scenario, Suite


def as_dicts(table: Sheet | None) -> list[dict[str, Any]]:
    assert table is not None
    return [dict(zip((c.head for c in table.columns), row, strict=True)) for row in table.rows]


# --- abilities

WORLD = World((Room("start"), Room("kitchen")), "start", about="w")
ABLE = replace(
    SUITE,
    tasks={
        "Visit": replace(
            SUITE.tasks["Visit"],
            abilities=("navigation", "report-back"),
            scenarios=(Scenario(WORLD, ()),),
        ),
        "FindBook": replace(SUITE.tasks["FindBook"], abilities=("navigation",)),
    },
)


def test_abilities_by_hand() -> None:
    run = made_up("a", {"Visit": (10, 4), "FindBook": (0,)})
    rows = {row["ability"]: row for row in as_dicts(ability_sheet([run], ABLE))}
    assert rows["report-back"]["pass@1"] == pytest.approx(0.7)
    assert rows["report-back"]["tasks"] == 1
    assert rows["navigation"]["pass@1"] == pytest.approx(14 / 30)
    failing = sum(rows["navigation"][name] for name in ("Python errors", "robot errors", "failed checks"))
    assert failing == pytest.approx(16 / 30)
    assert ability_sheet([run], SUITE) is None


def row(*drives: str, kind: str = "SayAtLocation") -> dict[str, Any]:
    trace = [["say", "hello"], *(["goto", place] for place in drives)]
    why = {"class": "TaskCompletionError", "kind": kind, "world": 0, "check": "c"}
    verdict = {"world": "w", "trace": trace, "status": "finished", "error": None}
    named = {"task": "Visit", "prompt": 0, "index": 0, "passed": False}
    return {**named, "failure": why, "verdicts": [verdict]}


@pytest.mark.parametrize(
    ("drives", "away"),
    [
        ((), False),
        (("kitchen",), True),
        (("kitchen", "start"), False),
        (("start", "kitchen"), True),
        (("the moon",), False),
        (("kitchen", "the moon"), True),
        (("kitchen", "to start please", "kitchen"), False),
    ],
)
def test_who_never_returned(drives: tuple[str, ...], *, away: bool) -> None:
    assert never_returned(row(*drives), ABLE) is away


def test_worlds_that_the_suite_has_no_more() -> None:
    gone: Suite = replace(ABLE, tasks={})
    assert not never_returned(row("kitchen"), gone)


def test_coming_back_by_hand() -> None:
    rows = (
        {**row(), "passed": True, "failure": None, "verdicts": []},
        row("kitchen"),
        row("kitchen", "start"),
        row("moon", kind="GoToInvalidLocation"),
    )
    run = made_up("a", {"Visit": (1,), "FindBook": (2,)})
    found = as_dicts(coming_back_sheet([replace(run, rows=rows)], ABLE))
    assert len(found) == 1
    assert (found[0]["failed"], found[0]["never returned"], found[0]["no such room"]) == (3, 1, 1)
    assert found[0]["share never returned"] == pytest.approx(1 / 3)
    table = coming_back_sheet([replace(run, rows=rows)], ABLE)
    assert table is not None
    (said,) = coming_back_said(table)
    assert re.search(
        r"^Of 3 failures of a .*\b1 .*\bnever came back\b.*\b1 .*\broom that does not exist", said
    )
    assert coming_back_sheet([run], SUITE) is None


def test_coming_back_without_failures() -> None:
    (found,) = as_dicts(coming_back_sheet([made_up("a", {"Visit": (10,)})], ABLE))
    assert found["share never returned"] is None


# --- phrasing


def told(run: JudgedRun, instructions: dict[int, str]) -> JudgedRun:
    written = {key: Written("", instructions[key[1]]) for key in run.written}
    return replace(run, written=written)


def test_the_spread_and_the_words_that_differ() -> None:
    run = told(
        made_up("a", {"Visit": (9, 2)}), {0: "Ask him what's there.", 1: "Inquire of him, what's there?"}
    )
    (found,) = as_dicts(spread_sheet([run], SUITE))
    assert found["spread"] == pytest.approx(0.7)
    assert (found["worst prompt"], found["best prompt"]) == (1, 0)
    assert (found["words of the worst only"], found["words of the best only"]) == ("inquire of", "ask")


def test_words_that_nobody_recorded() -> None:
    assert only(None, "a") == ("instruction not recorded",) * 2
    assert only("a a b", "b") == ("a", "")
    assert only(" ".join(map(str, range(20))), "")[0].endswith("11 and 8 more")


def test_which_phrasing_hurts() -> None:
    runs = [made_up("a", {"Visit": (10, 4)}), made_up("b", {"Visit": (6, 2), "FindBook": (1,)})]
    worst, best = as_dicts(phrasing_sheet(runs, SUITE))
    assert worst["prompt"] == 1
    assert worst["beside its task"] == pytest.approx(-0.25)
    assert (worst["hurts"], worst["of models"]) == (2, 2)
    assert best["beside its task"] == pytest.approx(0.25)


# --- cost


def paid(run: JudgedRun) -> JudgedRun:
    written = {key: Written("", None, 1_000, 500, 2.0) for key in run.written}
    return replace(run, written=written)


def test_cost_by_hand() -> None:
    run = paid(made_up("a", {"Visit": (4,)}))
    (found,) = as_dicts(cost_sheet([run], [Price("a", 10.0, 20.0)]))
    assert (found["input tokens"], found["output tokens"], found["seconds"]) == (10_000, 5_000, 20.0)
    assert found["money"] == pytest.approx(0.1 + 0.1)
    assert found["tokens per pass"] == pytest.approx(15_000 / 4)
    assert found["money per pass"] == pytest.approx(0.05)


def test_what_nobody_counted_costs_nothing_known() -> None:
    run = made_up("a", {"Visit": (4,)})
    assert cost_sheet([run], []) is None
    assert spent(run).tokens is None
    half = replace(run, written={**run.written, ("Visit", 0, 0): Written("", None, 1, 1, 1.0)})
    assert spent(half).tokens is None


def test_requests_by_hand() -> None:
    good = Trial(accepted=True, ran=True, passed=True)
    bad = Trial(accepted=False, ran=False, passed=False)
    assert requests(Prompt("T", 0, (good, bad)), 0) == 1
    assert requests(Prompt("T", 0, (good, bad)), 2) == 1 + 1 / 2 + 1 / 4
    assert requests(Prompt("T", 0, (bad,)), 4) == 5
    assert requests(Prompt("T", 0, (good,)), 100) == 1


def test_a_budget_by_hand() -> None:
    good = Trial(accepted=True, ran=True, passed=True)
    bad = Trial(accepted=False, ran=False, passed=False)
    run = replace(paid(made_up("a", {"Visit": (5,)})), trials=(Prompt("Visit", 0, (good, bad)),))
    rows = {row["retries"]: row for row in as_dicts(budget_sheet([run], [Price("a", 10.0, 20.0)]))}
    assert rows[0]["passes per 1,000 requests"] == pytest.approx(500)
    assert rows[2]["requests per program"] == pytest.approx(1.75)
    assert rows[2]["passes per 1,000 requests"] == pytest.approx(1_000 * 0.875 / 1.75)
    assert rows[0]["passes per million tokens"] == pytest.approx(0.5 * 1e6 / 1_500)
    assert rows[0]["passes per unit of money"] == pytest.approx(0.5 / 0.02)


def test_prices() -> None:
    assert price_from("openai-chat:gpt=1.5/6") == Price("openai-chat:gpt", 1.5, 6.0)
    for wrong in ("gpt", "gpt=1", "=1/2", "gpt=a/b", "gpt=-1/2", "gpt=nan/1", "gpt=1/2/3"):
        with pytest.raises(BadInput, match="MODEL=INPUT/OUTPUT"):
            price_from(wrong)
    run = made_up("a", {"Visit": (1,)})
    with pytest.raises(BadInput, match=r'--price .*"x".*\ba$'):
        expect_known([Price("x", 1, 1)], [run])
    with pytest.raises(BadInput, match=r'--price .*"a" twice'):
        expect_known([Price("a", 1, 1), Price("a", 2, 2)], [run])


def test_a_price_for_a_folder_goes_before_that_for_its_model() -> None:
    run = made_up("a", {"Visit": (1,)}, folder="cheap")
    assert price_of(run, [Price("a", 2, 2), Price("cheap", 1, 1)]) == Price("cheap", 1, 1)
    assert price_of(run, [Price("a", 2, 2)]) == Price("a", 2, 2)


def test_sums_do_not_depend_on_the_order_of_completions() -> None:
    run = made_up("a", {"Visit": (4,)})
    run = replace(
        run, written={key: Written("", None, 1, 1, 0.1 * n) for n, key in enumerate(run.written, 1)}
    )
    assert spent(run) == spent(replace(run, rows=tuple(reversed(run.rows))))


def test_what_was_not_judged_costs_nothing() -> None:
    run = paid(made_up("a", {"Visit": (4,)}))
    more = {**run.written, ("Visit", 0, 99): Written("", None, 10**9, 10**9, 1.0)}
    more["FindBook", 0, 0] = Written("")
    assert spent(replace(run, written=more)) == spent(run)
    assert budget_sheet([replace(run, written=more)], []) == budget_sheet([run], [])


def test_money_goes_by_what_each_prompt_takes() -> None:
    run = made_up("a", {"Visit": (1, 1)}, of=1)
    good, bad = (Trial(accepted=ok, ran=ok, passed=ok) for ok in (True, False))
    written = {
        ("Visit", 0, 0): Written("", None, 1_000, 0, 1.0),
        ("Visit", 1, 0): Written("", None, 0, 1_000, 1.0),
    }
    trials = (Prompt("Visit", 0, (good,)), Prompt("Visit", 1, (bad,)))
    run = replace(run, written=written, trials=trials)
    rows = {row["retries"]: row for row in as_dicts(budget_sheet([run], [Price("a", 1.0, 100.0)]))}
    # One request for the first prompt, and all three for the second, whose output is dear.
    assert rows[2]["passes per unit of money"] == pytest.approx(1 / (0.001 + 3 * 0.1))


# --- differences, groups, and where it comes from


def test_all_pairs_or_each_with_the_best() -> None:
    found = difference_sheet(usual())
    assert found is not None
    assert [row[0] for row in found[0].rows] == [
        "middle minus strong",
        "weak minus strong",
        "weak minus middle",
    ]
    assert len(found[1]) == 3
    assert difference_sheet(usual()[:1]) is None
    many = [made_up(f"m{n}", {"Visit": (n,)}) for n in range(8)]
    found = difference_sheet(many)
    assert found is not None
    assert {row[0].split(" minus ")[0] for row in found[0].rows if isinstance(row[0], str)} == {"m7"}
    assert difference_sheet([made_up("a", {"Visit": (1,)}), made_up("b", {"FindBook": (1,)})]) is None


def test_pairs_that_were_asked_otherwise_are_told() -> None:
    one, other = (
        made_up(name, {"Visit": (n,)}, about={"settings": {"temperature": n}}) for n, name in enumerate("ab")
    )
    found = difference_sheet([one, other])
    assert found is not None
    (note,) = found[0].notes
    assert re.search(r"^a and b: temperature\b.* 0 and 1", note)


def test_groups_of_failures_and_what_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    run = made_up("a", {"Visit": (3,)})
    found = failures([run], SUITE)
    assert sum(len(one.cluster.members) for one in found.shown) == 7
    assert found.notes == ()
    rows = as_dicts(failures_sheet(found))
    assert rows[0]["passes"] == "Visit/0/0"
    assert rows[0]["lines apart"] == 0
    monkeypatch.setattr("roboeval.report.failures.MOST", 2)
    monkeypatch.setattr("roboeval.report.failures.FEWEST", 2)
    (note,) = failures([run], SUITE).notes
    assert re.search(r"^a: 5 smaller groups with 5 completions .*`roboeval find`", note)


def test_where_it_comes_from() -> None:
    run = made_up("a", {"Visit": (3,)}, about={"settings": {"temperature": 0.2, "seed": None}})
    (found,) = as_dicts(origin_sheet([run]))
    assert found["settings"] == "temperature 0.2, seed null"
    assert found["suite hash"] == SUITE.digest
    assert found["prompt template"] == "not recorded"
    assert SUITE.digest in about_suite(SUITE, [run])[0]


def test_what_completions_say_of_their_cost() -> None:
    data = {"task": "T", "prompt": 0, "index": 0, "program": "x", "latency_s": 1.5}
    usage = {"input_tokens": 3, "output_tokens": True}
    read = _written(Completion.of({**data, "usage": usage}))
    assert (read.input_tokens, read.output_tokens, read.seconds) == (3, None, 1.5)
    assert _written(Completion.of({**data, "usage": 3, "latency_s": "x"})).seconds is None


@pytest.mark.parametrize("much", [10**400, 10**13, float("inf"), float("nan"), -1])
def test_what_nobody_can_have_counted(much: float) -> None:
    data = {"task": "T", "prompt": 0, "index": 0, "program": "x", "latency_s": much}
    read = _written(Completion.of({**data, "usage": {"input_tokens": much, "output_tokens": 1}}))
    assert (read.input_tokens, read.output_tokens, read.seconds) == (None, 1, None)
