"""Judging on a Ray cluster: a head and two nodes, started as processes that only this machine reaches."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import pytest

from codebotler.simulator.pool import MAX_KEYS_AHEAD, NO_SECCOMP
from codebotler.simulator.worker import EngineError
from command_line import ENVIRONMENT, roboeval
from roboeval.evaluation.engines import engine as engines
from roboeval.evaluation.engines import ray as rayengine
from roboeval.evaluation.engines.engine import Local, RunPrograms, Work
from roboeval.evaluation.engines.ray import VERSIONS, RayCluster, run_shard
from roboeval.evaluation.judging.judge import evaluate
from roboeval.evaluation.runs.rows import Row
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.suites.load import Suite

# Ray reads these variables when it is imported.
LOOPBACK_ONLY = "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"
os.environ |= {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": "0123456789abcdef" * 4, LOOPBACK_ONLY: "0"}
pytest.importorskip("ray", reason="Ray is an extra")
cluster_utils = pytest.importorskip("ray.cluster_utils", reason="Ray is an extra")

HERE = "127.0.0.1"
EVALUATE = ("evaluate", "recorded:hasty", "--engine", "ray", "--out")


def start(cwd: Path, *words: str, **variables: str | None) -> subprocess.Popen[str]:
    """Start Python in a process of its own, since Ray reads some variables only once."""
    environment = {**ENVIRONMENT, **os.environ, **variables}
    return subprocess.Popen(
        [sys.executable, *words],
        cwd=cwd,
        env={name: value for name, value in environment.items() if value is not None},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def make_works(numbers: range) -> Iterator[Work]:
    return (("", str(number)) for number in numbers)


# Cluster processes cannot import this module, so they can run its lambdas but not its functions.
NUMBERS: RunPrograms[int] = lambda _, works: [int(number) for _, number in works]  # noqa: E731 - a function cannot be sent


# --- without a cluster


def test_another_version_is_refused() -> None:
    functions = (lambda _, works: works, list)
    with pytest.raises(EngineError, match=r"has codebotler .*; install codebotler 0\.0\.1"):
        run_shard(functions, [], "codebotler 0.0.1 with Python 3.9", {})


def test_missing_isolation_is_refused_or_causes_one_warning(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(engines, "Worker", lambda **_: SimpleNamespace(has_seccomp=False, close=lambda: None))
    monkeypatch.setattr(rayengine, "own_worker", engines.own_worker.__wrapped__)
    functions, works = (NUMBERS, abs), list(make_works(range(2)))
    with pytest.raises(EngineError, match=re.escape(NO_SECCOMP)):
        run_shard(functions, works, VERSIONS, {"require_isolation": True})
    result = run_shard(functions, works, VERSIONS, {})
    cluster = RayCluster()
    cluster._ray = SimpleNamespace(wait=lambda shards, **_: (shards, []), get=lambda _: result)
    assert [values for _, values in cluster._wait_for_some(range(3))] == [[0, 1]] * 3
    (message,) = caplog.messages
    assert message.endswith(f": {NO_SECCOMP}")


ALONE = """
from roboeval.evaluation.engines.ray import RayCluster
with RayCluster() as cluster:
    import ray
    import psutil  # which comes with it
    works = [("", "1"), ("", "2"), ("", "1")]
    print(list(cluster.map_distinct(lambda worker, works: [int(n) for _, n in works], works, abs)))
    print([node["NodeManagerAddress"] for node in ray.nodes()])
    ours = {process.pid for process in psutil.Process().children(recursive=True)}
    sockets = [one for one in psutil.net_connections("tcp") if one.pid in ours and one.status == "LISTEN"]
    print({one.laddr.ip.removeprefix("::ffff:") for one in sockets})
print(ray.is_initialized())
"""


@pytest.mark.parametrize("address", [f"{HERE}:1", "nonsense", f"http://{HERE}:8265"])
def test_an_address_without_a_cluster_ends_the_command_without_files(tmp_path: Path, address: str) -> None:
    environment = {**ENVIRONMENT, **os.environ, "RAY_ADDRESS": address}
    ended = roboeval(*EVALUATE, "far", cwd=tmp_path, environment=environment)
    assert (ended.status, ended.out, ended.err.count("\n")) == (2, "", 1), ended
    assert ended.err.startswith(f"roboeval: RAY_ADDRESS: no Ray cluster answers at {address} (")
    assert not list(tmp_path.iterdir())


# --- on a cluster


class Nodes:
    """A head without a core, and nodes with one each, as processes of this machine."""

    def __init__(self) -> None:
        soon = {"health_check_period_ms": 200, "health_check_timeout_ms": 2000}
        head = {"num_cpus": 0, "node_ip_address": HERE, "include_dashboard": False, "_system_config": soon}
        self._cluster = cluster_utils.Cluster(initialize_head=True, head_node_args=head)
        self._nodes = [self._cluster.add_node(num_cpus=1, node_ip_address=HERE) for _ in range(2)]
        self.address = str(self._cluster.address)

    def kill(self) -> None:
        """Kill a node and all its processes, as a power failure does."""
        self._cluster.remove_node(self._nodes.pop(), allow_graceful=False)

    def end(self) -> None:
        self._cluster.shutdown()


@pytest.fixture(scope="module")
def background(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, subprocess.Popen[str]]]:
    """Start commands that mostly wait, one with a cluster of its own and one without any."""
    cwd = tmp_path_factory.mktemp("background")
    with ThreadingHTTPServer((HERE, 0), BaseHTTPRequestHandler) as server, TemporaryDirectory() as folder:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        other = {"RAY_ADDRESS": f"{HERE}:{server.server_port}", "RAY_py_gcs_connect_timeout_s": "1"}
        alone = {"RAY_ADDRESS": None, "RAY_TMPDIR": folder, LOOPBACK_ONLY: None}  # Sockets need short paths.
        processes = {
            "alone": start(cwd, "-c", ALONE, **alone),
            "other": start(cwd, "-m", "roboeval", *EVALUATE, "other", **other),
        }
        yield processes
        for process in processes.values():
            with process:
                process.kill()
        server.shutdown()


@pytest.fixture(scope="module")
def nodes(
    background: dict[str, subprocess.Popen[str]], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Nodes]:
    nodes = Nodes()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAY_ADDRESS", nodes.address)
        locked = tmp_path_factory.mktemp("locked")
        background["locked"] = start(locked, "-m", "roboeval", *EVALUATE, "run", RAY_AUTH_MODE="disabled")
        yield nodes
    nodes.end()


@pytest.fixture(scope="module")
def cluster(nodes: Nodes) -> Iterator[RayCluster]:
    assert nodes.address
    with RayCluster() as cluster:
        yield cluster


@pytest.fixture(scope="module")
def local_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Judge and check a run on this machine."""
    folder = tmp_path_factory.mktemp("local")
    assert roboeval("evaluate", "recorded:hasty", "--out", "run", cwd=folder).status == 0
    assert roboeval("resample", "run", cwd=folder).status == 0
    return folder / "run"


@pytest.mark.usefixtures("nodes")
def test_commands_on_a_cluster_write_the_same_bytes(local_run: Path, tmp_path: Path) -> None:
    assert roboeval(*EVALUATE, "run", cwd=tmp_path).status == 0
    assert roboeval("resample", "run", "--engine", "ray", cwd=tmp_path).status == 0
    for name in ("evaluations/paper.jsonl", "evaluations/paper.json"):
        assert (tmp_path / "run" / name).read_bytes() == (local_run / name).read_bytes()
    checks = (tmp_path / "run" / "checks" / "paper.jsonl").read_bytes()
    assert checks == (local_run / "checks" / "paper.jsonl").read_bytes() != b""


def test_ctrl_c_keeps_the_judged_rows(nodes: Nodes, tmp_path: Path) -> None:
    words = ("-m", "roboeval", *EVALUATE, "run", "--workers", "1")
    process = start(tmp_path, *words, RAY_ADDRESS=nodes.address)
    rows = tmp_path / "run" / "evaluations" / "paper.jsonl"
    while process.poll() is None and not (rows.exists() and rows.stat().st_size):
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate()
    assert process.returncode == 130
    assert any(line.startswith("roboeval: stopped; ") for line in err.splitlines()), err  # Ray may log more.
    assert all(json.loads(line) for line in rows.read_text().splitlines())


def test_programs_are_read_on_demand_and_equal_ones_run_once(cluster: RayCluster) -> None:
    read: list[int] = []

    def works() -> Iterator[Work]:
        for number in range(100_000):
            read.append(number)
            yield "", str(number % 3000)

    results = cluster.map_distinct(
        lambda _, some: [(int(n), time.time_ns()) for _, n in some], works(), tuple
    )
    first = [next(results) for _ in range(50)]
    assert [number for number, _ in first] == list(range(50))
    assert len(read) <= 50 + MAX_KEYS_AHEAD
    more = [next(results) for _ in range(6000)]
    del results
    assert more[2950:3000] == first  # They are the same calls.
    assert len(read) <= 6050 + MAX_KEYS_AHEAD


def test_an_error_of_a_call_is_raised_here(cluster: RayCluster) -> None:
    results = cluster.map_distinct(
        lambda _, works: [1 // (int(number) - 1) for _, number in works], make_works(range(2)), abs
    )
    with pytest.raises(ZeroDivisionError):
        list(results)


def test_dropping_results_does_no_harm(cluster: RayCluster) -> None:
    for number in range(40):  # Cancelling a shard that had just ended aborted this process.
        results = cluster.map_distinct(NUMBERS, make_works(range(500)), abs)
        assert [next(results) for _ in range(number + 1)] == [*range(number + 1)]
        del results


@pytest.mark.parametrize("name", ["locked", "other"])
@pytest.mark.usefixtures("nodes")
def test_a_cluster_that_refuses_or_does_not_answer_ends_the_command(
    name: str, background: dict[str, subprocess.Popen[str]]
) -> None:
    out, err = background[name].communicate()
    assert (background[name].returncode, out) == (2, "")
    last = err.splitlines()[-1]
    assert last.startswith("roboeval: RAY_ADDRESS: ")
    assert ("RAY_AUTH_MODE" in last) == (name == "locked")


def test_without_an_address_a_local_cluster_is_started(
    background: dict[str, subprocess.Popen[str]],
) -> None:
    out, err = background["alone"].communicate()
    assert out.splitlines() == ["[1, 2, 1]", "['127.0.0.1']", "{'127.0.0.1'}", "False"], err


class OpenCluster:
    """A cluster that is already open."""

    def __init__(self, cluster: RayCluster) -> None:
        self.cluster = cluster

    def __enter__(self) -> RayCluster:
        return self.cluster

    def __exit__(self, *_: object) -> None:
        pass


def test_killed_nodes_lose_nothing_until_none_is_left(
    nodes: Nodes, cluster: RayCluster, paper: Suite, monkeypatch: pytest.MonkeyPatch
) -> None:
    completions = list(recorded_completions("recorded:hasty", paper))
    here = list(evaluate(completions, paper, engine=Local(2)))
    there: list[Row] = []
    for row in evaluate(completions, paper, engine=OpenCluster(cluster)):
        there.append(row)
        if len(there) == 20:
            nodes.kill()
    assert there == here
    nodes.kill()
    monkeypatch.setattr(rayengine, "RAY_POLL_SECONDS", 1)
    with pytest.raises(EngineError, match="no cores left"):
        list(cluster.map_distinct(NUMBERS, make_works(range(2)), int))
