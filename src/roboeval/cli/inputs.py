"""The suites and judged runs that command lines name."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from codebotler.core.words import counted
from roboeval.cli.output import note, watched

if TYPE_CHECKING:
    from roboeval.evaluation.runs.folder import Run
    from roboeval.evaluation.runs.results import Results
    from roboeval.suites.load import Suite


def load(suite: str, rules: Path | None = None, skills: Sequence[Path] | None = None) -> Suite:
    """Read a suite by name or folder, files of further skills, and the rules of a house."""
    from codebotler.checking.evasions import find_evasions
    from codebotler.core.errors import UserError
    from codebotler.core.skills.files import skills_from
    from codebotler.core.skills.paper import SKILLS
    from roboeval.suites.house import HouseRules
    from roboeval.suites.load import load_suite, rooms_in

    read = load_suite(suite, skills=skills_from(*(skills or ())))
    if rules is not None and read.house is not None:
        raise UserError(
            f'the suite "{read.name}" has house rules of its own, which would not count; leave out --rules'
        )
    if rules is None:
        return read
    rooms = rooms_in(read.tasks.values())
    house = HouseRules.read(rules, read.skills, rooms)
    for sentence in find_evasions(house.rules, rooms, SKILLS):  # in simulation, rules see inside own skills
        note(sentence)
    return read.with_house_rules(house)


def command(
    verb: str, *arguments: object, suite: str, ablated: bool = False, rules: Path | None = None
) -> str:
    """A command line to paste."""
    words = ["roboeval", verb, *map(str, arguments)]
    words += [] if suite == "paper" else ["--suite", suite]
    words += ["--ablation"] if ablated else []
    words += [] if rules is None else ["--rules", str(rules)]
    return shlex.join(words)


class Opened(NamedTuple):
    """A judged run that a user names."""

    results: Results
    again: str  # the command that goes on with judging it


def note_houses(runs: Iterable[Run], suite: str) -> None:
    """Say that runs were judged with house rules, too, which are not shown unless they are named."""
    if houses := dict.fromkeys(house for run in runs for house in run.houses(suite)):
        files = " or ".join(f"--rules {house}.yaml" for house in houses)
        note(f"judged with house rules, too; {files} shows that")


def expect_same_suite(opened: Sequence[Opened]) -> None:
    """Raise UserError if runs were judged by suites of different content."""
    from codebotler.core.errors import UserError

    digests = [str(one.results.head.get("digest")) for one in opened]
    if len({*digests}) == 1:
        return
    now = opened[0].results.known_suite.digest
    stale = next(at for at, digest in enumerate(digests) if digest != now)
    other = next(at for at, digest in enumerate(digests) if digest != digests[stale])
    paths = " and ".join(str(opened[at].results.run.path) for at in (stale, other))
    hashes = " and ".join(digests[at][:8] for at in (stale, other))
    raise UserError(
        f"{paths} were judged by different versions of a suite ({hashes}); "
        f"`{opened[stale].again} --redo` judges it by the current suite"
    )


def open_run(
    run: Path,
    suite_name: str,
    *,
    ablated: bool,
    rules: Path | None = None,
    reuse_from: Results | None = None,
    on_line: Callable[[bytes], None] | None = None,
) -> Opened:
    """Read a judged run; `on_line` is called with each line of its verdicts.

    The completions are taken over from `reuse_from`, another evaluation of the same run.
    """
    from codebotler.core.errors import UserError
    from roboeval.evaluation.runs.folder import evaluation_of
    from roboeval.evaluation.runs.results import read_results

    again = command("evaluate", run, suite=suite_name, ablated=ablated, rules=rules)
    folder, key, suite = evaluation_of(run, load(suite_name, rules), ablated=ablated, again=again)
    results = read_results(
        folder,
        key,
        suite,
        reuse_from=reuse_from,
        on_line=on_line,
        progress=lambda lines, total: watched(lines, "reading", total),
    )
    if suite.house is not None and rules is not None:
        judged_by = results.head.get("house_rules") or {}
        if judged_by.get(suite.house.name) != suite.house.digest:
            raise UserError(
                f"has changed since the run was judged; `{again} --redo` judges by it", file=rules
            )
    if results.head.get("digest") != suite.digest:
        note("the suite has changed since this run was judged; explanations may be missing")
    more = _to_go_on(results, suite)
    return Opened(results, command("evaluate", run, *more, suite=suite_name, ablated=ablated, rules=rules))


def open_current(
    run: Path,
    suite_name: str,
    *,
    ablated: bool,
    rules: Path | None = None,
    reuse_from: Results | None = None,
    on_line: Callable[[bytes], None] | None = None,
) -> Opened:
    """Read a judged run of which every verdict counts, as `open_run` does.

    Raises UserError if there is none, or if the programs were changed since.
    """
    from codebotler.core.errors import UserError

    opened = open_run(run, suite_name, ablated=ablated, rules=rules, reuse_from=reuse_from, on_line=on_line)
    if (complaint := complaint_of(opened.results)) is not None:
        raise UserError(f"{complaint}; `{opened.again} --redo` judges the current programs")
    if opened.results.table.is_empty():
        raise UserError(f"no completion has been judged; `{opened.again}` continues", file=run)
    if (unfinished := unfinished_of(opened.results)) is not None:
        note(f"{unfinished}, and only those count; `{opened.again}` continues")
    return opened


def complaint_of(results: Results) -> str | None:
    """A sentence about rows whose programs are no longer in the run; None without such rows."""
    from roboeval.evaluation.runs.completions import name_of

    if not (stale := results.stale):
        return None
    others = len(stale) - 1
    judge = f"and {counted(others, 'other row')} judge" if others else "judges"
    return f"{name_of(stale[0])} {judge} a program that is no longer in {results.run.completions}"


def unfinished_of(results: Results) -> str | None:
    """A clause about completions that are not judged yet; None without such completions."""
    from roboeval.evaluation.runs.completions import how_many

    count, total = len(results.places), results.scope.total
    return None if count >= total else f"{count:,} of {how_many(total)} judged"


def _to_go_on(results: Results, suite: Suite) -> list[str]:
    """Options with which a command goes on with an evaluation."""
    from roboeval.evaluation.runs.folder import tasks_to_judge

    words = []
    every = tasks_to_judge(suite, None, ablated=bool(results.head.get("ablation")))[0]
    if results.tasks is not None and results.tasks != every:
        words += ["--tasks", ",".join(sorted(results.tasks))]
    if suite.with_own_worlds().digest != suite.digest:
        words += ["--worlds", str(suite.worlds), "--seed", str(suite.seed)]
    return words
