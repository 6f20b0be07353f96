"""What a program that passes costs: tokens, time and money, with and without rejection sampling."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from codebotler.badinput import BadInput
from roboeval.report.reading import JudgedRun
from roboeval.report.sheets import Cell, Column, Sheet, sheet
from roboeval.resampling import LIMITS, Prompt, chances

MILLION = 1_000_000
ABOUT = (
    "Sums over the completions of which the run says how many tokens and how much time they took; what "
    "passes is counted among the same. Money is in the unit of the prices that were given with --price."
)
BUDGET = (
    "How many requests a program takes on average where rejected ones are asked for again, and how many "
    "programs that pass come of 1,000 requests, of a million tokens and of one unit of money. What a check "
    "costs is not counted: it takes milliseconds, and no tokens."
)


@dataclass(frozen=True)
class Price:
    """What a model costs.

    Args:
        model: the name of the run's model, or of its folder.
        input: of a million tokens of input.
        output: of a million tokens of output.
    """

    model: str
    input: float
    output: float


def price_from(text: str) -> Price:
    """Read `MODEL=INPUT/OUTPUT`.

    Raises:
        BadInput: it is none.
    """
    model, _, numbers = text.rpartition("=")
    try:
        there, back = map(float, numbers.split("/"))
    except ValueError:
        there = back = -1.0
    if not model or not 0 <= there < MILLION or not 0 <= back < MILLION:
        raise BadInput(f'"{text}" is no price; write MODEL=INPUT/OUTPUT, of a million tokens each')
    return Price(model, there, back)


@dataclass(frozen=True)
class Spent:
    """What some completions took; None where nobody counted."""

    completions: int
    passed: int
    input_tokens: int | None
    output_tokens: int | None
    seconds: float | None

    def money(self, price: Price | None) -> float | None:
        """What they cost."""
        if price is None or self.input_tokens is None or self.output_tokens is None:
            return None
        return (self.input_tokens * price.input + self.output_tokens * price.output) / MILLION

    @property
    def tokens(self) -> int | None:
        """Both kinds together."""
        both = self.input_tokens, self.output_tokens
        return None if None in both else sum(n for n in both if n is not None)


def spent(run: JudgedRun) -> Spent:
    """What the completions of a run took, as far as it says so of each."""
    rows = [(row["passed"], run.written.get((row["task"], row["prompt"], row["index"]))) for row in run.rows]
    told = [(passed, w) for passed, w in rows if w is not None]
    counted = [w for _, w in told if w.input_tokens is not None and w.output_tokens is not None]
    tokens = [(w.input_tokens or 0, w.output_tokens or 0) for w in counted]
    whole = len(counted) == len(rows) and any(a or b for a, b in tokens)
    timed = [w.seconds for _, w in told if w.seconds is not None]
    return Spent(
        completions=len(rows),
        passed=sum(passed for passed, _ in rows),
        input_tokens=sum(a for a, _ in tokens) if whole else None,
        output_tokens=sum(b for _, b in tokens) if whole else None,
        seconds=sum(timed) if len(timed) == len(rows) and any(timed) else None,
    )


def price_of(run: JudgedRun, prices: Iterable[Price]) -> Price | None:
    """The price that was given for a run."""
    return next((price for price in prices if price.model in {run.model, run.folder, run.name}), None)


def expect_known(prices: Iterable[Price], runs: Sequence[JudgedRun]) -> None:
    """Refuse a price of what is not there.

    Raises:
        BadInput: no run has the model or the name.
    """
    for price in prices:
        if not any(price_of(run, [price]) for run in runs):
            names = ", ".join(run.name for run in runs)
            raise BadInput(f'--price names "{price.model}", but the runs are {names}')


def cost_sheet(runs: Sequence[JudgedRun], prices: Sequence[Price]) -> Sheet | None:
    """What each run took, and what each of its programs that pass; None if no run says it."""
    rows: list[list[Cell]] = []
    for run in runs:
        took = spent(run)
        money = took.money(price_of(run, prices))
        if took.tokens is not None or took.seconds is not None:
            sums = [took.input_tokens, took.output_tokens, took.seconds, money]
            each = [_per(total, took.passed) for total in (took.tokens, took.seconds, money)]
            rows.append([run.name, took.completions, took.passed, *sums, *each])
    columns = (
        Column("model"),
        Column("completions", "count"),
        Column("passed", "count"),
        Column("input tokens", "count"),
        Column("output tokens", "count"),
        Column("seconds", "number"),
        Column("money", "number"),
        Column("tokens per pass", "number"),
        Column("seconds per pass", "number"),
        Column("money per pass", "number"),
    )
    return sheet("cost", "What a program that passes costs", columns, rows, about=ABOUT) if rows else None


def _per(total: float | None, count: float) -> float | None:
    return None if total is None or not count else total / count


def requests(prompt: Prompt, retries: int) -> float:
    """How many requests a program of a prompt takes on average: until one is accepted, or none is left.

    Args:
        prompt: its completions, checked.
        retries: how often a rejected one is asked for again.
    """
    rejected = sum(not trial.accepted for trial in prompt.trials) / len(prompt.trials)
    return sum(rejected**n for n in range(retries + 1))


def budget_sheet(runs: Sequence[JudgedRun], prices: Sequence[Price]) -> Sheet | None:
    """What a budget gives at each limit of retries; None if no run was checked."""
    rows: list[list[Cell]] = []
    for run in runs:
        took = spent(run)
        money = took.money(price_of(run, prices))
        shares = _by_prompt(run)
        for limit in LIMITS if run.trials else ():
            asked = [requests(prompt, limit) for prompt in run.trials or ()]
            passed = sum(chances(prompt.trials, limit).passed for prompt in run.trials or ())
            weighed = zip(asked, run.trials or (), strict=True)
            used = sum(n * shares.get((p.task, p.prompt), 0.0) for n, p in weighed) if took.tokens else None
            paid = None if money is None or used is None or not took.tokens else used * money / took.tokens
            rows.append(
                [
                    run.name,
                    limit,
                    sum(asked) / len(asked),
                    1_000 * passed / sum(asked),
                    _per(MILLION * passed, used) if used else None,
                    _per(passed, paid) if paid else None,
                ]
            )
    columns = (
        Column("model"),
        Column("retries", "count"),
        Column("requests per program", "number"),
        Column("passes per 1,000 requests", "number"),
        Column("passes per million tokens", "number"),
        Column("passes per unit of money", "number"),
    )
    return sheet("budget", "What a budget gives", columns, rows, about=BUDGET) if rows else None


def _by_prompt(run: JudgedRun) -> Mapping[tuple[str, int], float]:
    """The mean number of tokens of a request, by prompt."""
    tokens: defaultdict[tuple[str, int], list[int]] = defaultdict(list)
    for (task, prompt, _), written in run.written.items():
        if written.input_tokens is not None and written.output_tokens is not None:
            tokens[task, prompt].append(written.input_tokens + written.output_tokens)
    return {key: sum(those) / len(those) for key, those in tokens.items()}
