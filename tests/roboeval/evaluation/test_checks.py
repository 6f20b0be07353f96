"""How many model-written programs a check rejects, with one seed; bench/check.py takes more."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from check import CAUGHT, LOST, LOST_IN_A_TASK, Source, rates, real, rejections, truths
from codebotler.simulator.pool import WorkerPool
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.suites.load import Suite

EVERY = 8


@pytest.fixture(scope="module")
def pool() -> Iterator[WorkerPool]:
    with WorkerPool(1) as started:
        yield started


@pytest.mark.slow
def test_rates_on_real_programs(
    corpus: Path, paper: Suite, pool: WorkerPool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CODEBOTLER_CORPUS", str(corpus))
    sources = list(dict.fromkeys(real(paper)))[::EVERY]
    found = rates(sources, truths(sources, paper, 1), rejections(sources, paper, [0], pool))
    assert found.certain.checks > 20
    assert found.right.checks > 40
    assert found.certain.share >= CAUGHT
    assert found.right.share <= LOST
    assert found.worst[1].share <= LOST_IN_A_TASK
    assert found.hold


@pytest.mark.slow
def test_right_careful_programs_are_accepted_and_wrong_ones_rejected(paper: Suite, pool: WorkerPool) -> None:
    rows = [(c.task, c.program) for c in recorded_completions("recorded:careful", paper)]
    sources: list[Source] = list(dict.fromkeys(rows))
    true = truths(sources, paper, 1)
    said = rejections(sources, paper, [0, 1], pool)
    right = [each for truth, each in zip(true, said, strict=True) if truth.passed]
    ends = {"IndexError", "PlaceNoObject"}
    wrong = [each for truth, each in zip(true, said, strict=True) if truth.kinds & ends]
    assert len(right) > 80
    assert not any(map(any, right))
    assert len(wrong) > 1
    assert all(map(all, wrong))
