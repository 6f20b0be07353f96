"""Rollouts are judged in batches, and none is blamed for a failure of the engine."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.errors import UserError
from codebotler.simulator.worker import EngineError
from roboeval import reward
from roboeval.evaluation import rewards
from roboeval.suites.families.suite import FIRST_SEEDS
from roboeval.suites.families.tasks import GeneratedTask, trained_task
from roboeval.suites.suite import HouseRules
from roboeval.training import prompts
from roboeval.training.prompts import load_prompts, program_in
from roboeval.training.rollouts import Components, Rollout, judge

FAMILY = "BringThing"


def speech(text: str) -> Rollout:
    return Rollout(FAMILY, 1, 0, f"def task_program():\n    say({text!r})\n")


def test_components_of_a_right_a_broken_and_an_idle_program() -> None:
    task = trained_task(FAMILY, 1)
    right, broken, idle = judge(
        [
            Rollout(FAMILY, 1, 0, program)
            for program in (task.solution, "def task_program(", "task_program = list")
        ]
    )
    assert right == Components(1, 1, 1, 1, 1, 1)
    assert (broken.reward, broken.parses, broken.without_errors) == (0, 0, 0)
    assert (idle.reward, idle.parses, idle.without_errors, idle.passed) == (0, 1, 1, 0)
    assert 0 < idle.requirements < 1


def test_the_reward_is_that_of_the_library() -> None:
    task = trained_task(FAMILY, 1)
    programs = [task.solution, "", *(one.program for one in task.wrong)]
    found = judge([Rollout(FAMILY, 1, 2, program) for program in programs])
    assert [one.reward for one in found] == reward(task.name, 2, programs, suite=task.suite)


def test_kept_house_rules_are_a_separate_component(tmp_path: Path) -> None:
    path = tmp_path / "quiet.yaml"
    path.write_text('rules:\n  - {name: quiet, says: Never speak., always: not tr.Exists(say(".*"))}\n')
    loud, silent = speech("hello"), Rollout(FAMILY, 1, 0, "def task_program():\n    go_to('start_loc')\n")
    found = judge([loud, silent], house=HouseRules.read(path))
    assert [one.rules_kept for one in found] == [0, 1]
    assert [one.rules_kept for one in judge([loud, silent])] == [1, 1]


def test_equal_rollouts_are_judged_once_and_progress_is_reported() -> None:
    reports: list[int] = []
    many = [speech(f"message {number % 40}") for number in range(80)]
    found = judge(many, progress=reports.append)
    assert len(found) == 80
    assert found[:40] == found[40:]
    assert reports == sorted(reports)
    assert reports[-1] == 40
    judge(many, progress=reports.append)
    assert reports[-1] == 40, "nothing is judged again"


def test_a_failure_of_the_engine_is_an_error_and_no_reward(monkeypatch: pytest.MonkeyPatch) -> None:
    def raise_error(*_: object) -> object:
        raise EngineError("no process can be started")

    monkeypatch.setattr(rewards, "judge_batch", raise_error)
    with pytest.raises(EngineError, match="no process"):
        judge([speech("never judged before")])


def test_a_prompt_that_does_not_exist_is_refused() -> None:
    with pytest.raises(UserError, match=r"BringThing-1 has no prompt 4; .*0 to 3"):
        judge([Rollout(FAMILY, 1, 4, "")])


# --- prompts


def test_prompts_are_reproducible_and_splits_share_no_task() -> None:
    few = [FAMILY, "OfferThing"]
    assert load_prompts(count=20, only=few) == load_prompts(count=20, only=few)
    assert load_prompts(count=20, seed=1, only=few)[0]["seed"] == 20
    tasks = [
        {(row["family"], row["seed"]) for row in load_prompts(split, count=40, only=few)}
        for split in FIRST_SEEDS
    ]
    assert [len(one) for one in tasks] == [40] * 3
    assert not tasks[0] & tasks[1] | tasks[1] & tasks[2] | tasks[0] & tasks[2]


def test_prompts_stay_the_same_bytes() -> None:
    rows = load_prompts("test", count=40, seed=2, only=["BringThing", "OfferThing"])
    found = hashlib.sha256(json.dumps(rows).encode()).hexdigest()
    assert found == "fb3236546db764c2b6e0683e5c70f3d6e184b9dd1a9ce798113572c3e93701b7"


def test_only_one_task_of_each_family_gets_worlds(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []

    def record_family(family: str, seed: int) -> GeneratedTask:
        made.append(family)
        return trained_task(family, seed)

    monkeypatch.setattr(prompts, "trained_task", record_family)
    reports: list[int] = []
    load_prompts(count=100, only=["BringThing", "OfferThing"], progress=reports.append)
    assert made == ["BringThing", "OfferThing"]
    assert reports == [*range(1, 101)]


def test_phrasings_take_turns_in_any_choice_of_families() -> None:
    rows = load_prompts(count=8, only=["BringThing"])
    assert [row["prompt_index"] for row in rows] == [0, 1, 2, 3] * 2
    assert {row["prompt_index"] for row in load_prompts(count=17 * 4)} == {0, 1, 2, 3}


def test_a_prompt_can_be_messages_or_a_text() -> None:
    (chat,), (text,) = load_prompts(count=1), load_prompts(count=1, form="text")
    instruction = trained_task(chat["family"], chat["seed"]).prompts[chat["prompt_index"]]
    assert chat["prompt"][0]["role"] == "system"
    assert chat["prompt"][-1] == {"role": "user", "content": instruction}
    assert text["prompt"].endswith(text["opening"])
    assert chat["opening"] == ""


@pytest.mark.parametrize(
    ("completion", "opening"),
    [
        ("```python\ndef task_program():\n    say('a')\n```", ""),
        (
            [
                {"role": "user", "content": "b"},
                {"role": "assistant", "content": "def task_program():\n    say('a')"},
            ],
            "",
        ),
        ([{"content": [{"type": "text", "text": "def task_program():\n    say('a')"}]}], ""),
        (
            "    say('a')\n\n\n# Instruction: say b\ndef task_program():\n    say('b')\n",
            "def task_program():\n",
        ),
    ],
)
def test_a_program_is_found_in_a_completion(completion: str | list[dict[str, Any]], opening: str) -> None:
    assert program_in(completion, opening).strip() == "def task_program():\n    say('a')"


@pytest.mark.parametrize("completion", [[], [{"role": "assistant"}]])
def test_a_completion_without_content_is_refused(completion: list[dict[str, Any]]) -> None:
    with pytest.raises(UserError, match="a completion has no message with content"):
        program_in(completion)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"split": "exam"}, 'unknown split "exam"; .*train, validation and test'),
        ({"only": ["Fly"]}, 'unknown family "Fly"'),
        ({"only": "BringThing"}, "the families .* list"),
        ({"count": 0}, "the number of prompts is 0, but it must be at least 1"),
        ({"seed": 1_000_000}, "the seed is 1000000, but with 1,000 prompts it must be from 0 to 999,999"),
    ],
)
def test_wrong_arguments_are_refused(wrong: dict[str, object], sentence: str) -> None:
    with pytest.raises(UserError, match=sentence):
        load_prompts(**wrong)  # type: ignore[arg-type]  # The argument is wrong on purpose.
