"""Opens the suites and judged runs that command lines name."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from codebotler.core.errors import UserError
from codebotler.core.terminal import visible
from roboeval.cli.output import note, show_progress

if TYPE_CHECKING:
    from roboeval.evaluation.runs.completions import CompletionKey
    from roboeval.evaluation.runs.results import Results
    from roboeval.suites.load import Suite

Selection: TypeAlias = tuple[str, *tuple[int, ...]]
"""A part of a run: a task, a prompt such as `("LunchTime", 0)`, or the key of a completion."""


def load_suite_option(suite: str, rules: Path | None = None, skills: Sequence[Path] | None = None) -> Suite:
    """Read a suite by its name or folder, and add the house rules and the skills in the given files."""
    from codebotler.checking.house_rules.rooms import find_evasions
    from codebotler.core.skills.files import skills_from
    from codebotler.core.skills.paper import SKILLS
    from roboeval.suites.load import load_suite, rooms_in
    from roboeval.suites.suite import HouseRules

    read = load_suite(suite, skills=skills_from(*(skills or ())))
    if rules is not None and read.house is not None:
        raise UserError(f'the suite "{read.name}" has its own house rules; leave out --rules')
    if rules is None:
        return read
    rooms = rooms_in(read.tasks.values())
    house = HouseRules.read(rules, read.skills, rooms)
    for sentence in find_evasions(house.rules, rooms, SKILLS):  # simulation sees calls inside users' skills
        note(sentence)
    return read.with_house_rules(house)


def parse_selection(text: str, suite: Suite) -> Selection:
    """Parse TASK, TASK/PROMPT or TASK/PROMPT/INDEX, such as `LunchTime/0/12`. Raise UserError otherwise."""
    name, *numbers = text.removesuffix("/").split("/")
    if len(numbers) > 2 or not all(n.isascii() and n.isdecimal() and len(n) < 10 for n in numbers):  # noqa: PLR2004 - parts
        forms = "TASK, TASK/PROMPT or TASK/PROMPT/INDEX"
        raise UserError(f'"{visible(text)}" is not a valid selection; write {forms}')
    known = next((task for task in suite.tasks if task.lower() == name.lower()), name)
    return (suite.task(known).name, *map(int, numbers))


def expect_judged(selection: Selection, judged: Iterable[CompletionKey]) -> None:
    """Raise UserError if the selection contains none of the `judged` completions."""
    if not any(key[: len(selection)] == selection for key in judged):
        part = "/".join(map(str, selection))
        raise UserError(f"no completion of {part} is judged in this run; `roboeval show RUN` lists its tasks")


def names_completion(text: str) -> bool:
    """Whether a text such as `LunchTime/0/12` names one completion: a task, a prompt and an index."""
    return text.removesuffix("/").count("/") == 2  # noqa: PLR2004 - two slashes separate three parts


def command(
    verb: str, *arguments: object, suite: str, ablated: bool = False, rules: Path | None = None
) -> str:
    """Return a command line for a shell, such as `roboeval show my-run --suite plus`."""
    words = ["roboeval", verb, *map(str, arguments)]
    words += [] if suite == "paper" else ["--suite", suite]
    words += ["--ablation"] if ablated else []
    words += [] if rules is None else ["--rules", str(rules)]
    return shlex.join(words)


def expect_same_suite(opened: Sequence[Results], suite: str) -> None:
    """Raise UserError if the runs were judged by different versions of a suite, given by name or folder."""
    digests = [one.manifest.get("digest") for one in opened]
    if len({*digests}) > 1:
        now = opened[0].required_suite.digest
        stale = next(one for one, digest in zip(opened, digests, strict=True) if digest != now)
        why = "this run was judged by another version of the suite"
        again = evaluate_again(stale, suite)
        raise UserError(f"{why}; `{again} --redo` judges the run again", file=stale.run.path)


def open_run(
    run: Path,
    suite_name: str,
    *,
    ablated: bool,
    rules: Path | None = None,
    completion: str | None = None,
    reuse_from: Results | None = None,
) -> Results:
    """Read a judged run. If a completion such as `LunchTime/0/12` is given, read only the rows of its task.

    `ablated` selects the common-sense-only verdicts. If given, `reuse_from` provides the completions.
    """
    from roboeval.evaluation.runs.folder import evaluation_of
    from roboeval.evaluation.runs.results import read_results

    again = command("evaluate", run, suite=suite_name, ablated=ablated, rules=rules)
    suite = load_suite_option(suite_name, rules)
    folder, key, suite = evaluation_of(run, suite, ablated=ablated, again=again)
    results = read_results(
        folder,
        key,
        suite,
        task=None if completion is None else parse_selection(completion, suite)[0],
        reuse_from=reuse_from,
        progress=lambda lines, total: show_progress(lines, "reading", total),
    )
    if suite.house is not None and rules is not None:
        judged_by = results.manifest.get("house_rules") or {}
        if judged_by.get(suite.house.name) != suite.house.digest:
            changed = f"has changed since the run was judged; `{again} --redo` judges with the new rules"
            raise UserError(changed, file=rules)
    if results.manifest.get("digest") != suite.digest:
        note("the suite has changed since this run was judged; explanations may be missing")
    return results


def open_with_results(
    run: Path, suite_name: str, *, ablated: bool, rules: Path | None = None, reuse_from: Results | None = None
) -> Results:
    """Read a run with `open_run`. Print a note if it is partly judged, or raise UserError if not at all."""
    results = open_run(run, suite_name, ablated=ablated, rules=rules, reuse_from=reuse_from)
    unjudged = unjudged_sentence(results, suite_name, rules)
    if results.table.is_empty():
        raise UserError(unjudged or "the run contains no completions; `roboeval run` adds some", file=run)
    if unjudged:
        note(f"only judged completions count: {unjudged}")
    return results


def unjudged_sentence(results: Results, suite_name: str, rules: Path | None) -> str | None:
    """Return how many completions are judged and how to judge the rest, or None if all are judged."""
    from roboeval.evaluation.runs.completions import how_many

    count, total = len(results.places), results.scope.total
    again = evaluate_again(results, suite_name, rules)
    return f"{count:,} of {how_many(total)} judged; `{again}` continues" if count < total else None


def evaluate_again(results: Results, suite_name: str, rules: Path | None = None) -> str:
    """Return the `roboeval evaluate` command that continues an evaluation with the same options."""
    from roboeval.evaluation.runs.folder import tasks_to_judge

    words, suite, ablated = [], results.required_suite, results.is_ablated
    every = tasks_to_judge(suite, None, ablated=ablated)[0]
    if results.tasks is not None and results.tasks != every:
        words += ["--tasks", ",".join(sorted(results.tasks))]
    if suite.with_own_worlds().digest != suite.digest:
        words += ["--worlds", str(suite.worlds), "--seed", str(suite.seed)]
    return command("evaluate", results.run.path, *words, suite=suite_name, ablated=ablated, rules=rules)
