"""Options and fixtures for all tests: the corpus of real programs, the paper's suite, one engine."""

import gc
import os
import signal
import ssl
from collections.abc import Generator, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import pytest
from hypothesis import HealthCheck, settings

import messages
import processor_time
import shared_workers
from codebotler.rtl.text import claims
from codebotler.simulator.process.isolated_call import ClosedProcess
from codebotler.simulator.worker import Worker
from roboeval.suites.load import Suite, load_suite

# There is no deadline: a busy machine is not the code's fault. CI tries the same examples each time.
settings.register_profile(
    "quick",
    max_examples=20,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize="CI" in os.environ,
)
settings.register_profile("thorough", settings.get_profile("quick"), max_examples=500, derandomize=False)
settings.load_profile("quick")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--no-skips", action="store_true", help="Fail tests that are skipped.")
    parser.addoption("--messages", help="Write the messages of all errors to this file.")
    parser.addoption("--processor-time", help="Write the processor seconds of each test to this file.")
    parser.addoption("--shots", help="Write screenshots of tests in a browser to this folder.")


ERROR_MESSAGES: messages.Said = {}


def pytest_configure(config: pytest.Config) -> None:
    """Let Ctrl-C interrupt tests and their processes even in the background, where shells ignore it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if config.getoption("--messages"):
        messages.collect(ERROR_MESSAGES)
    config.pluginmanager.register(processor_time.ProcessorTime(config.getoption("--processor-time")))


def pytest_collection_finish() -> None:
    """Leave thousands of collected tests out of each garbage collection, which otherwise takes seconds."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> object:  # noqa: ANN401 - xdist has no types
    """Let `--dist loadgroup` keep tests with the same parameter in one process."""
    if config.getoption("dist") != "loadgroup":
        return None
    from sharing import ByParameter  # noqa: PLC0415 - xdist may be missing

    return ByParameter(config, log)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:  # noqa: ANN401 - xdist has no types
    """Add the error messages of a worker process to ours."""
    ERROR_MESSAGES.update(getattr(node, "workeroutput", {}).get("messages", {}))


def pytest_sessionfinish(session: pytest.Session) -> None:
    file = session.config.getoption("--messages")
    if file and hasattr(session.config, "workeroutput"):
        session.config.workeroutput["messages"] = ERROR_MESSAGES
    elif file:
        Path(file).write_text(messages.written(ERROR_MESSAGES), encoding="utf-8")


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    return _fail_if_skipped((yield), collector.config)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    return _fail_if_skipped((yield), item.config)


Report = TypeVar("Report", pytest.CollectReport, pytest.TestReport)


def _fail_if_skipped(report: Report, config: pytest.Config) -> Report:
    if report.skipped and config.getoption("--no-skips"):
        report.outcome = "failed"
        report.longrepr = f"skipped, but --no-skips was given: {report.longrepr}"
    return report


@pytest.fixture(scope="session", autouse=True)
def no_certificate_authorities() -> Iterator[None]:
    """Load no public certificate authorities: that takes 30 ms a client, and tests stay on this machine."""
    load = ssl.SSLContext.load_verify_locations

    def load_others(context: ssl.SSLContext, cafile: Any = None, *more: Any, **named: Any) -> None:  # noqa: ANN401 - like its base
        if not str(cafile).endswith("certifi/cacert.pem"):
            load(context, cafile, *more, **named)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ssl.SSLContext, "load_verify_locations", load_others)
        yield


@pytest.fixture(scope="session", autouse=True)
def known_clauses() -> Iterator[None]:
    """Keep the clauses of more texts than a user's process does: the linter reads most of its texts often."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(claims, "_polarities", lru_cache(100_000)(claims._polarities.__wrapped__))
        yield


@pytest.fixture(scope="session", autouse=True)
def engine() -> Iterator[None]:
    """Share one engine between all tests."""
    with shared_workers.shared():
        yield
    shared_workers.end_all()


@pytest.fixture(autouse=True)
def separate_engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let tests of the engine start its processes like a user does, unless marked `shared_engine`."""
    if request.path.parent.name == "simulator" and not request.node.get_closest_marker("shared_engine"):
        shared_workers.end_all()
        monkeypatch.setattr("codebotler.simulator.pool.Worker", Worker)
        monkeypatch.setattr("codebotler.simulator.process.isolated_call.ClosedProcess", ClosedProcess)


@pytest.fixture(scope="session")
def corpus() -> Path:
    """Return the folder of real programs and published results; skip tests where it is missing."""
    folder = os.environ.get("CODEBOTLER_CORPUS")
    if not folder:
        pytest.skip("CODEBOTLER_CORPUS is not set: the corpus of real programs is missing")
    return Path(folder)


@pytest.fixture(scope="session")
def paper() -> Suite:
    return load_suite("paper")
