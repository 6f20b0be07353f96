"""What all tests share: the corpus of real programs, where it is at hand, and the paper's suite."""

import gc
import os
import signal
import ssl
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any, TypeVar

import pytest
from hypothesis import HealthCheck, settings

import messages
import processor_time
import shared_workers
from codebotler.simulator.process.isolated_call import ClosedProcess
from codebotler.simulator.worker import Worker
from roboeval.suites.load import Suite, load_suite

# Without a deadline, since a busy machine is no fault of the code. CI tries the same examples each time.
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
    parser.addoption("--no-skips", action="store_true", help="A test that is skipped has failed.")
    parser.addoption("--messages", help="The file that gets every sentence that an error has said.")
    parser.addoption("--processor-time", help="The file that gets the processor seconds of each test.")
    parser.addoption("--shots", help="The folder that gets the screenshots of tests in a browser.")


SAID: messages.Said = {}


def pytest_configure(config: pytest.Config) -> None:
    """Let Ctrl-C be what it is on a terminal, also for what tests start: jobs in the background ignore it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if config.getoption("--messages"):
        messages.collect(SAID)
    config.pluginmanager.register(processor_time.ProcessorTime(config.getoption("--processor-time")))


def pytest_collection_finish() -> None:
    """Leave thousands of collected tests out of each garbage collection, which otherwise takes seconds."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> object:  # noqa: ANN401 - xdist has no types
    """Let `--dist loadgroup` go by parameters."""
    if config.getoption("dist") != "loadgroup":
        return None
    from sharing import ByParameter  # noqa: PLC0415 - xdist need not be there

    return ByParameter(config, log)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:  # noqa: ANN401 - xdist has no types
    """Take over what was said in a process that has run a part of the tests."""
    SAID.update(getattr(node, "workeroutput", {}).get("messages", {}))


def pytest_sessionfinish(session: pytest.Session) -> None:
    file = session.config.getoption("--messages")
    if file and hasattr(session.config, "workeroutput"):
        session.config.workeroutput["messages"] = SAID
    elif file:
        Path(file).write_text(messages.written(SAID), encoding="utf-8")


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    return _unskipped((yield), collector.config)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    return _unskipped((yield), item.config)


Report = TypeVar("Report", pytest.CollectReport, pytest.TestReport)


def _unskipped(report: Report, config: pytest.Config) -> Report:
    if report.skipped and config.getoption("--no-skips"):
        report.outcome = "failed"
        report.longrepr = f"skipped, where nothing may be: {report.longrepr}"
    return report


@pytest.fixture(scope="session", autouse=True)
def no_authorities() -> Iterator[None]:
    """Load no public certificate authorities: that takes 30 ms a client, and tests stay on this machine."""
    load = ssl.SSLContext.load_verify_locations

    def load_others(context: ssl.SSLContext, cafile: Any = None, *more: Any, **named: Any) -> None:  # noqa: ANN401 - as its base has it
        if not str(cafile).endswith("certifi/cacert.pem"):
            load(context, cafile, *more, **named)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ssl.SSLContext, "load_verify_locations", load_others)
        yield


@pytest.fixture(scope="session", autouse=True)
def engine() -> Iterator[None]:
    """One engine for all tests."""
    with shared_workers.shared():
        yield
    shared_workers.end_all()


@pytest.fixture(autouse=True)
def engine_of_its_own(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let tests of the engine itself start its processes as users do, unless they are marked otherwise."""
    if request.path.parent.name == "simulator" and not request.node.get_closest_marker("shared_engine"):
        shared_workers.end_all()
        monkeypatch.setattr("codebotler.simulator.pool.Worker", Worker)
        monkeypatch.setattr("codebotler.simulator.process.isolated_call.ClosedProcess", ClosedProcess)


@pytest.fixture(scope="session")
def corpus() -> Path:
    """The folder of real programs and published results; without it, tests over it are skipped."""
    folder = os.environ.get("CODEBOTLER_CORPUS")
    if not folder:
        pytest.skip("CODEBOTLER_CORPUS is not set: the corpus of real programs is not at hand")
    return Path(folder)


@pytest.fixture(scope="session")
def paper() -> Suite:
    return load_suite("paper")
