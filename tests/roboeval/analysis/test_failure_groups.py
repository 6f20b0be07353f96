"""Groups of failures: their members, their order and their descriptions."""

import json
from typing import Any, cast

from codebotler.models.no_program import NO_PROGRAM_SENTENCES
from made_results import results_of
from roboeval.analysis.failure_groups import describe_groups, group_data, group_failures
from roboeval.cli.views.groups import failure_group_view
from roboeval.evaluation.runs.completions import CompletionKey
from roboeval.evaluation.runs.rows import Failure, Row, WorldVerdict, key_of
from small_run import HOSTILE, SHOWN, SUITE, row, text_of

GOES = """\
def task_program():
    here = "{0}"
    go_to(here)
    go_to("hall")
    say("hello")
    say("you")
    say("all")
"""
RIGHT = GOES.format("hall").replace("you", "me")


def failure(prompt: int, index: int, *, task: str = "Visit", check: str = "visits()") -> Row:
    verdict: WorldVerdict = {
        "world": "w",
        "satisfied": False,
        "status": "finished",
        "error": None,
        "line": None,
        "failed_checks": [check],
        "trace": [["goto", "hall"]],
        "places": [],
    }
    why: Failure = {"class": "TaskCompletionError", "kind": "Location", "world": 1, "check": check}
    first: WorldVerdict = {**verdict, "satisfied": True, "failed_checks": [], "trace": [["say", "x"]]}
    made = {
        "task": task,
        "prompt": prompt,
        "index": index,
        "passed": False,
        "failure": why,
        "verdicts": [first, verdict],
    }
    return cast("Row", made)


def test_similar_programs_that_fail_the_same_check_are_one_group() -> None:
    rows = [failure(0, 0), failure(0, 1), failure(1, 0), failure(0, 2), failure(0, 3, check="other()")]
    programs: dict[CompletionKey, str] = {
        ("Visit", 0, 0): GOES.format("lab"),
        ("Visit", 0, 1): GOES.format("lab").replace("here", "there"),
        ("Visit", 1, 0): GOES.format("room"),
        ("Visit", 0, 2): "def task_program():\n    pass\n",
        ("Visit", 0, 3): GOES.format("lab"),
    }
    rows.append(failure(0, 0, task="FindBook"))
    programs["FindBook", 0, 0] = GOES.format("lab")
    found = [
        [(row["task"], row["prompt"], row["index"]) for row in those]
        for those in group_failures(rows, programs)
    ]
    assert found == [
        [("Visit", 0, 0), ("Visit", 0, 1), ("Visit", 1, 0)],
        [("FindBook", 0, 0)],
        [("Visit", 0, 2)],
        [("Visit", 0, 3)],
    ]


def test_replies_without_a_program_are_one_group_without_a_fix() -> None:
    rows = [row(0, index, ("NoProgram", kind)) for index, kind in enumerate(("refusal", "refusal", "empty"))]
    ran = {"world": "w", "satisfied": False, "status": "python-error", "line": None}
    ran |= {"error": {"kind": "SyntaxError", "message": "invalid syntax"}, "failed_checks": [], "trace": []}
    rows = [{**one, "verdicts": [ran]} for one in rows] + [row(1, 0)]
    programs: dict[CompletionKey, str] = {
        ("Visit", 0, 0): "No.",
        ("Visit", 0, 1): "I must not do that,\nsince ...",
    }
    programs |= {("Visit", 0, 2): "", ("Visit", 1, 0): RIGHT}
    results = results_of(rows, SUITE, programs)
    refused, empty = describe_groups(group_failures(cast("list[Row]", rows[:3]), programs), results)
    assert [len(one.members) for one in (refused, empty)] == [2, 1]
    assert (refused.fix, refused.why) == (None, NO_PROGRAM_SENTENCES["refusal"])
    text = text_of(failure_group_view(refused))
    assert NO_PROGRAM_SENTENCES["refusal"] in text
    assert 'in "' not in text, "no robot was in a world"


def test_large_groups_come_first() -> None:
    rows = [failure(n, 0, task=task, check=f"{n}()") for task in ("Visit", "FindBook") for n in range(3)]
    rows += [failure(9, n, check="nine()") for n in range(2)]
    programs = {key_of(row): "" for row in rows}
    found = [(those[0]["task"], those[0]["prompt"]) for those in group_failures(rows, programs)]
    assert found == [("Visit", 9), *((task, n) for task in ("FindBook", "Visit") for n in range(3))]


def describe_group(program: str = GOES.format("lab")) -> Any:  # noqa: ANN401 - one group
    rows = [failure(0, n) for n in range(3)]
    programs = {("Visit", 0, 0): "pass", ("Visit", 0, 1): program, ("Visit", 0, 2): program}
    programs["Visit", 4, 0] = RIGHT
    results = results_of([*rows, {**row(4, 0), "passed": True}], SUITE, programs)
    (one,) = describe_groups([[*map(results.row, results.failed)]], results)
    return one


def test_the_most_frequent_program_represents_its_group() -> None:
    one = describe_group()
    assert one.representative == ("Visit", 0, 1)
    assert len(one.members) == 3
    assert one.prompts == [0]
    assert one.fix.name == "Visit/4/0"
    assert one.fix.changed == 4


def test_a_group_as_json() -> None:
    data = json.loads(json.dumps(group_data(describe_group())))
    assert (data["size"], data["representative"], data["world"]) == (3, "Visit/0/1", "w")
    assert '+    say("me")' in data["fix"]["difference"]


def test_hostile_text_in_a_group_stays_text() -> None:
    shown = text_of(failure_group_view(describe_group(f"say({HOSTILE}")), width=200)
    assert SHOWN.removesuffix("\\n") in shown
    assert "\x1b" not in shown
    assert shown.startswith("3 completions of Visit, failed check: Location")
