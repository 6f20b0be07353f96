"""Chances after retries: exact ones against random draws, and the figures of a small run."""

import random
from typing import Any, NamedTuple

import polars as pl
import pytest

from made_results import table_of
from roboeval.analysis.metrics import PromptScore, TaskScore, overall, pass_at_1
from roboeval.analysis.resample import (
    LIMITS,
    Chances,
    CheckedPrompt,
    count_by_prompt,
    curve_data,
    final_chances,
    resample,
)
from roboeval.cli.views.groups import resample_view
from roboeval.evaluation.runs.scope import Coverage
from small_run import row, text_of


class Trial(NamedTuple):
    accepted: bool
    ran: bool
    passed: bool


def prompt(trials: list[Trial], number: int = 0) -> CheckedPrompt:
    good = [trial for trial in trials if trial.accepted]
    ran, passed = (sum(one.ran for one in trials), sum(one.passed for one in trials))
    both = sum(one.ran for one in good), sum(one.passed for one in good)
    return CheckedPrompt("Visit", number, len(trials), len(good), ran, passed, *both)


GOOD = Trial(accepted=True, ran=True, passed=True)
WRONG = Trial(accepted=True, ran=True, passed=False)
UNSEEN = Trial(accepted=True, ran=False, passed=False)
REJECTED = Trial(accepted=False, ran=False, passed=False)
WRONGLY_REJECTED = Trial(accepted=False, ran=True, passed=True)


def draw(trials: list[Trial], retries: int, chance: random.Random) -> Trial:
    trial = chance.choice(trials)
    while retries and not trial.accepted:
        trial, retries = chance.choice(trials), retries - 1
    return trial


@pytest.mark.parametrize("retries", [0, 1, 2, 4, 8])
def test_chances_agree_with_many_random_draws(retries: int) -> None:
    trials = [GOOD, WRONG, UNSEEN, WRONGLY_REJECTED, *[REJECTED] * 6]
    chance = random.Random(11)
    times = 20_000
    results = [draw(trials, retries, chance) for _ in range(times)]
    exact = final_chances(prompt(trials), retries)
    for name in ("accepted", "ran", "passed"):
        share = sum(getattr(trial, name) for trial in results) / times
        assert getattr(exact, name) == pytest.approx(share, abs=0.012), name


def test_without_retries_chances_are_plain_shares() -> None:
    trials = [GOOD, WRONG, REJECTED, WRONGLY_REJECTED]
    exact = final_chances(prompt(trials), 0)
    assert (exact.accepted, exact.ran, exact.passed) == pytest.approx((2 / 4, 3 / 4, 2 / 4))


@pytest.mark.parametrize("seed", range(10))
def test_without_retries_the_mean_is_pass_at_1_to_the_last_digit(seed: int) -> None:
    chance = random.Random(seed)
    kinds = [GOOD, WRONG, UNSEEN, REJECTED, WRONGLY_REJECTED]
    prompts = [
        prompt(chance.choices(kinds, k=chance.randint(1, 20)), number)
        for number in range(chance.randint(1, 80))
    ]
    scores = [PromptScore("Visit", p.prompt, p.completions, p.passed) for p in prompts]
    score = TaskScore("Visit", tuple(scores))
    found = resample(prompts, 0)
    assert found.passed == overall([score], 1)
    assert {("Visit", n): one.passed for n, one in enumerate(found.by_prompt)} == pass_at_1([score])


@pytest.mark.parametrize("retries", [1, 3, 100])
def test_no_chance_is_above_one(retries: int) -> None:
    for accepted in range(1, 30):
        trials = [GOOD] * accepted + [WRONGLY_REJECTED] * (30 - accepted)
        exact = final_chances(prompt(trials), retries)
        assert max(exact.accepted, exact.ran, exact.passed) <= 1
        assert exact.passed == pytest.approx(1)


def test_one_retry_by_hand() -> None:
    # One of two is accepted, and passes: it is drawn at once, or in the second of two draws.
    assert final_chances(prompt([GOOD, REJECTED]), 1) == Chances(accepted=3 / 4, ran=3 / 4, passed=3 / 4)


def test_where_none_or_all_are_accepted_retries_change_nothing() -> None:
    for retries in LIMITS:
        assert final_chances(prompt([REJECTED, WRONGLY_REJECTED]), retries) == Chances(
            accepted=0, ran=1 / 2, passed=1 / 2
        )
        assert final_chances(prompt([GOOD, WRONG]), retries) == Chances(accepted=1, ran=1, passed=1 / 2)


def verdict(status: str, *, satisfied: bool = False, failed: tuple[str, ...] = ()) -> dict[str, Any]:
    return {"status": status, "satisfied": satisfied, "failed_checks": list(failed)}


@pytest.mark.parametrize(
    ("verdicts", "expected"),
    [
        ([verdict("finished"), verdict("finished", satisfied=True)], True),
        ([verdict("finished"), verdict("robot-error")], False),
        ([verdict("python-error")], False),
        ([verdict("killed")], False),
        ([verdict("timeout")], False),
        ([verdict("timeout", satisfied=True)], True),
        ([verdict("timeout", failed=("greets",))], True),
    ],
)
def test_a_program_runs_if_its_checks_were_judged(verdicts: list[dict[str, Any]], expected: bool) -> None:  # noqa: FBT001 - a table of cases
    why = {"class": "TaskCompletionError", "kind": "Location", "world": 0, "check": "greets"}
    one = {**row(0, 0), "passed": False, "failure": why, "verdicts": verdicts}
    (prompt,) = count_by_prompt(table_of([one]).with_columns(accepted=pl.lit(value=True)))
    assert (prompt.ran, prompt.accepted_and_ran) == (expected, expected)


PROMPTS = (
    prompt([GOOD, REJECTED, REJECTED, REJECTED]),
    prompt([REJECTED] * 4, 1),
)


def test_limits_over_prompts() -> None:
    none, hundred = resample(PROMPTS, 0), resample(PROMPTS, 100)
    assert none.passed.mean == pytest.approx(1 / 8)
    assert none.prompts == {0.25: 1 / 2, 0.5: 0, 0.75: 0, 1.0: 0}
    assert hundred.passed.mean == pytest.approx(1 / 2)
    assert hundred.prompts[1.0] == 1 / 2  # After 100 retries, a good program is almost certain.
    assert hundred.accepted == pytest.approx(1 / 2)


def test_data_of_both_figures() -> None:
    data = curve_data(PROMPTS, LIMITS)
    assert [limit["retries"] for limit in data["limits"]] == [0, 2, 4, 8, 100]
    assert data["prompts"][0]["pass@1"]["2"] == pytest.approx(1 - (3 / 4) ** 3)
    assert data["prompts"][1] == {
        "task": "Visit",
        "prompt": 1,
        "completions": 4,
        "accepted": 0,
        "passed": 0,
        "pass@1": dict.fromkeys(["0", "2", "4", "8", "100"], 0),
    }
    after = data["accepted_after"]
    assert len(after) == 101
    assert after == sorted(after)
    assert after[0] == pytest.approx(1 / 8)


def test_the_table_says_how_many_completions_it_covers() -> None:
    shown = text_of(resample_view(PROMPTS, LIMITS, title="runs/x", coverage=Coverage(3, 4, 5)))
    assert "over 3 of 5 completions (1 missing, 1 not judged)" in shown
    assert [line.split()[:2] for line in shown.splitlines() if line.strip()[:1].isdigit()] == [
        ["0", "0.125"],
        ["2", "0.289"],
        ["4", "0.381"],
        ["8", "0.462"],
        ["100", "0.500"],
    ]
