"""Options that commands share, and the suites, runs and engines that they name."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple, TypeVar

import typer

from codebotler.core.words import counted
from roboeval.cli.output import fail, note, watched

if TYPE_CHECKING:
    from roboeval.evaluation.engines import OpenEngine
    from roboeval.evaluation.runs.folder import Run
    from roboeval.evaluation.runs.results import Results
    from roboeval.suites.load import Suite


# --- what a shell completes


def suite_names(incomplete: str) -> list[str]:
    """The suites that ship with RoboEval or are installed; the shell itself completes folders."""
    from roboeval.suites.installed import installed_suites
    from roboeval.suites.load import shipped_suites

    names = {*shipped_suites(), *(suite.name for suite in installed_suites())}
    return sorted(name for name in names if name.startswith(incomplete))


def task_names(context: typer.Context, incomplete: str) -> list[str]:
    """The tasks of the suite that the line names, or of the paper's."""
    from codebotler.core.errors import UserError
    from roboeval.suites.load import suite_folder, task_files

    try:
        files = task_files(suite_folder(context.params.get("suite") or "paper"))
    except UserError:
        return []
    return [file.stem for file in files if file.stem.startswith(incomplete)]


def listed_task_names(context: typer.Context, incomplete: str) -> list[str]:
    """The tasks for the last of several names, which commas separate."""
    *whole, last = incomplete.split(",")
    return [",".join([*whole, name]) for name in task_names(context, last) if name not in whole]


def split_names(incomplete: str) -> list[str]:
    """The splits of families."""
    from roboeval.suites.families.suite import SPLITS

    return [name for name in SPLITS if name.startswith(incomplete)]


def engine_names(incomplete: str) -> list[str]:
    """The engines."""
    return [name for name in ("local", "ray") if name.startswith(incomplete)]


# --- options


def named(what: str) -> Callable[[str], Path]:
    """A reader of paths that refuses the empty one, which would be the current folder."""

    def path(text: str) -> Path:
        return Path(text) if text else fail(f"the argument is empty; name {what}")

    return path


SourceArgument = Annotated[
    str, typer.Argument(help="A run, a .jsonl, a folder or zip of .py completions, or recorded:NAME.")
]
KeepOption = Annotated[
    Path | None,
    typer.Option(help="Keep completions and verdicts in this run folder.", parser=named("a run")),
]
RedoOption = Annotated[
    bool, typer.Option("--redo", help="Discard earlier verdicts and judge everything again.")
]
TaskOption = Annotated[
    str | None, typer.Option(help="Only completions of this task.", autocompletion=task_names)
]
InWorldOption = Annotated[
    str | None, typer.Option(help="Only in this world: its number, from 1, or its description.")
]
RunArgument = Annotated[Path, typer.Argument(help="A run folder.", parser=named("a run"))]
SuiteOption = Annotated[
    str,
    typer.Option(
        help="The name of a built-in or installed suite, or a folder.",
        autocompletion=suite_names,
    ),
]
TasksOption = Annotated[
    str | None,
    typer.Option(help="Only these tasks, separated by commas.", autocompletion=listed_task_names),
]
AblationOption = Annotated[bool, typer.Option("--ablation", help="Judge only the common-sense requirements.")]
RulesOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="A file of house rules; a program is stopped where it breaks one, and has failed.",
        parser=named("a file of rules"),
    ),
]
EngineOption = Annotated[
    str,
    typer.Option(
        help="Where to run programs: local (this machine) or ray (a Ray cluster).",
        autocompletion=engine_names,
    ),
]
WorkersOption = Annotated[
    int | None, typer.Option(min=1, help="How many programs to run at the same time; all cores by default.")
]
IsolationOption = Annotated[
    bool, typer.Option("--require-isolation", help="Refuse to run programs without full isolation.")
]
ProcessOption = Annotated[
    bool,
    typer.Option("--one-process-per-run", help="Give every run its own process, which takes longer."),
]
WorldsOption = Annotated[
    int | None,
    typer.Option(min=1, max=10_000, help="Draw this many worlds a task, if the suite draws worlds."),
]
SeedOption = Annotated[
    int | None, typer.Option(min=0, help="Draw the worlds from this seed instead of the suite's own.")
]
RequestsOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Ask no model, but write the requests to this file, for a batch endpoint.",
        parser=named("a file"),
    ),
]
FamiliesOption = Annotated[
    str | None,
    typer.Option(
        metavar="SPLIT",
        help="Fresh tasks of families, from train, validation or test; --seed chooses them.",
        autocompletion=split_names,
    ),
]
NumTasksOption = Annotated[
    int | None,
    typer.Option(min=1, max=100, help="With --families: how many tasks; by default one of each family."),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
OutOption = Annotated[
    Path | None, typer.Option(help="The run folder; by default runs/MODEL.", parser=named("a run"))
]
NumOption = Annotated[int, typer.Option(min=1, max=10_000, help="Completions for each prompt.")]
ConcurrencyOption = Annotated[int, typer.Option(min=1, help="Requests under way at the same time.")]
RateOption = Annotated[
    float | None, typer.Option(min=0.001, help="Send at most this many requests a minute.")
]
BudgetOption = Annotated[
    int | None, typer.Option(min=1, help="Stop when this command has used this many tokens.")
]


Command = TypeVar("Command", bound=Callable[..., None])


# --- what a user names


def load(suite: str, rules: Path | None = None, skills: Sequence[Path] | None = None) -> Suite:
    """Read a suite by name or folder, files of further skills, and the rules of a house."""
    from codebotler.checking.evasions import evasions
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
    for sentence in evasions(house.rules, rooms, SKILLS):  # in simulation, rules see inside own skills
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


IN_THREADS = 2  # workers that one process keeps busy
MANY = 5_000  # programs for which it is worth while to start processes


@contextmanager
def engine_named(name: str, workers: int | None, **isolation: bool) -> Iterator[Callable[[int], OpenEngine]]:
    """The engine with this name for so many programs, isolated as `WorkerPool` says.

    A worker starts beside what follows.
    """
    if name == "local":
        from codebotler.simulator.pool import WorkerPool, cores
        from roboeval.evaluation.engines import Local

        workers = workers or cores()
        with closing(WorkerPool(workers, **isolation)) as pool:

            def local(programs: int) -> OpenEngine:
                if programs < MANY or min(workers, cores()) <= IN_THREADS:
                    return Local(pool)
                from roboeval.evaluation.processes import Processes

                pool.close()  # it has warned if need be
                return Processes(workers, **isolation)

            yield local
        return
    if name != "ray":
        fail(f'there is no engine "{name}"; use local or ray')
    from roboeval.evaluation.ray import RayCluster

    cluster = RayCluster(workers, **isolation)  # refused before anything is written
    yield lambda _: cluster
