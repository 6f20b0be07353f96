"""Judging on a Ray cluster: a head and two nodes, started as processes that only this machine reaches."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from codebotler.badinput import BadInput
from codebotler.simulator.distinct import MOST_AHEAD
from codebotler.simulator.engine import NO_SECCOMP, EngineError
from codebotler.simulator.lane import Lane
from command_line import ENVIRONMENT, roboeval
from roboeval.evaluation import ray as rayengine
from roboeval.evaluation.completions import recorded_completions
from roboeval.evaluation.engines import Local
from roboeval.evaluation.judge import evaluate
from roboeval.evaluation.ray import LARGEST, LOOPBACK_ONLY, OURS, Cluster, Shards, Told, call_all
from roboeval.evaluation.rayaddress import PING_PATIENCE_S
from roboeval.evaluation.rows import Row
from roboeval.suites.load import Suite

# Read when Ray is imported.
os.environ |= {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": "0123456789abcdef" * 4, LOOPBACK_ONLY: "0"}
ray = pytest.importorskip("ray", reason="Ray is an extra")
cluster_utils = pytest.importorskip("ray.cluster_utils", reason="Ray is an extra")

HERE = "127.0.0.1"


# --- without a cluster: first, as long as there is none


def test_shards_are_small_at_first() -> None:
    given: list[list[int]] = []

    def give(keys: Any) -> int:  # noqa: ANN401 - keys of a shard
        given.append(list(keys))
        return len(given)

    shards: Shards[int] = Shards(give)
    keys = iter(range(1000))
    for _ in range(60):
        for _, key in zip(range(shards.size(4)), keys, strict=False):
            shards.add(str(key).encode(), key)
        shards.send()
    sizes = list(map(len, given))
    assert sizes[:8] == [1] * 8
    assert sizes == sorted(sizes)
    assert sizes[-1] == LARGEST
    assert [key for those in given for key in those] == list(range(sum(sizes)))
    shards.send()  # there is nothing in it
    assert len(given) == 60


def test_another_version_does_not_judge() -> None:
    told = call_all(lambda _, key: key, [1], ("0.0.1", "3.9"))
    assert told.values == ()
    assert re.search(r"codebotler 0\.0\.1 .*Python 3\.9", str(told.complaint))
    assert call_all(lambda _, key: key, [1], OURS).values == (1,)


def test_a_wall_that_is_missing_is_told_once_or_refused(caplog: pytest.LogCaptureFixture) -> None:
    bare = Told((1,), has_seccomp=False, machine="far")
    lenient = Cluster()
    for _ in range(3):
        lenient._look_at_walls(bare)
    assert caplog.messages == [f"far: {NO_SECCOMP}"]
    with pytest.raises(EngineError, match=r"^far: .*isolated"):
        Cluster(require_isolation=True)._look_at_walls(bare)
    Cluster(require_isolation=True)._look_at_walls(Told((1,)))


ALONE = """
from roboeval.evaluation.ray import Cluster
with Cluster() as cluster:
    import ray
    import psutil  # which comes with it
    print(list(cluster.map_distinct(lambda lane, key: key, [1, 2, 1], name=lambda k: b"%d" % k, then=abs)))
    print([node["NodeManagerAddress"] for node in ray.nodes()])
    ours = {process.pid for process in psutil.Process().children(recursive=True)}
    sockets = [one for one in psutil.net_connections("tcp") if one.pid in ours and one.status == "LISTEN"]
    print({one.laddr.ip.removeprefix("::ffff:") for one in sockets})
print(ray.is_initialized())
"""


def alone(folder: str, address: str = "") -> subprocess.CompletedProcess[str]:
    environment = {
        name: value for name, value in os.environ.items() if name not in {"RAY_ADDRESS", LOOPBACK_ONLY}
    }
    return subprocess.run(
        [sys.executable, "-c", ALONE],
        env={**environment, "RAY_TMPDIR": folder, "RAY_ADDRESS": address},
        capture_output=True,
        text=True,
        check=False,
    )


def test_ray_that_was_imported_before_would_let_others_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LOOPBACK_ONLY, "1")
    monkeypatch.setenv("RAY_ADDRESS", "localhost:6379")
    with pytest.raises(BadInput, match=f"{LOOPBACK_ONLY}=0"):
        Cluster()


def test_where_ray_cannot_start_there_is_a_sentence(tmp_path: Path) -> None:
    ended = alone(str(tmp_path / ("long" * 20)))
    assert "BadInput: Ray cannot be started" in ended.stderr.splitlines()[-1]


@pytest.mark.parametrize("address", ["", "local"])
def test_a_cluster_is_started_where_there_is_none_and_only_this_machine_reaches_it(address: str) -> None:
    with TemporaryDirectory() as folder:  # whose name is short: there are sockets in it
        ended = alone(folder, address)
    assert ended.stdout.splitlines() == ["[1, 2, 1]", "['127.0.0.1']", "{'127.0.0.1'}", "False"], ended


def test_without_a_cluster_at_the_address_the_command_ends_soon_and_leaves_nothing(tmp_path: Path) -> None:
    with socket.create_server((HERE, 0)) as server:
        port = server.getsockname()[1]
    started = time.monotonic()
    for address in (f"{HERE}:{port}", "nonsense", f"ray://{HERE}:10001", f"http://{HERE}:8265"):
        ended = roboeval(
            *("evaluate", "recorded:hasty", "--out", "far", "--engine", "ray"),
            cwd=tmp_path,
            environment={**ENVIRONMENT, **os.environ, "RAY_ADDRESS": address},
        )
        assert (ended.status, ended.out, ended.err.count("\n")) == (2, "", 1), ended
        assert ended.err.startswith("roboeval: RAY_ADDRESS: ")
        assert not list(tmp_path.iterdir())
    assert time.monotonic() - started < 60


def test_a_server_that_is_no_cluster_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    with ThreadingHTTPServer((HERE, 0), BaseHTTPRequestHandler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        monkeypatch.setenv("RAY_ADDRESS", f"{HERE}:{server.server_port}")
        started = time.monotonic()
        with pytest.raises(BadInput, match="does not answer"):
            Cluster()
        assert time.monotonic() - started < 2 * PING_PATIENCE_S
        server.shutdown()


# --- on a cluster


class Nodes:
    """A head without a core, and nodes with one each, as processes of this machine."""

    def __init__(self) -> None:
        head = {"num_cpus": 0, "node_ip_address": HERE, "include_dashboard": False}
        self._cluster = cluster_utils.Cluster(initialize_head=True, head_node_args=head)
        self._nodes = [self._cluster.add_node(num_cpus=1, node_ip_address=HERE) for _ in range(2)]
        self.address = str(self._cluster.address)
        self.port_of_a_node = self._nodes[0].node_manager_port

    def kill(self) -> None:
        """Kill a node with all that belongs to it, as a machine that loses its power."""
        self._cluster.remove_node(self._nodes.pop(), allow_graceful=False)

    def end(self) -> None:
        self._cluster.shutdown()


@pytest.fixture(scope="module")
def nodes() -> Iterator[Nodes]:
    nodes = Nodes()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAY_ADDRESS", nodes.address)
        yield nodes
    nodes.end()


def environment(nodes: Nodes) -> dict[str, str]:
    return {**ENVIRONMENT, **os.environ, "RAY_ADDRESS": nodes.address}


def test_the_command_writes_the_same_bytes(nodes: Nodes, tmp_path: Path) -> None:
    local = roboeval("evaluate", "recorded:hasty", "--out", "local", cwd=tmp_path)
    far = roboeval(
        *("evaluate", "recorded:hasty", "--out", "far", "--engine", "ray"),
        cwd=tmp_path,
        environment=environment(nodes),
    )
    assert (far.status, far.out.replace("far", "local")) == (0, local.out), far
    assert re.fullmatch(r"verdicts are in far; .*\n", far.err), far.err
    for name in ("paper.jsonl", "paper.sha256", "paper.json"):
        there, here = (tmp_path / run / "evaluations" / name for run in ("far", "local"))
        assert there.read_bytes() == here.read_bytes()


def test_a_cluster_that_wants_its_token_says_so(nodes: Nodes, tmp_path: Path) -> None:
    for token in ({"RAY_AUTH_TOKEN": "f" * 64}, {"RAY_AUTH_MODE": "disabled"}):
        ended = roboeval(
            *("evaluate", "recorded:hasty", "--out", "far", "--engine", "ray"),
            cwd=tmp_path,
            environment={**environment(nodes), **token},
        )
        assert (ended.status, ended.out) == (2, "")
        assert re.fullmatch(r"roboeval: RAY_ADDRESS: .* RAY_AUTH_MODE=.*\n", ended.err)
        assert not list(tmp_path.iterdir())


def test_what_is_of_ray_and_no_head_is_not_waited_for(nodes: Nodes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAY_ADDRESS", f"{HERE}:{nodes.port_of_a_node}")
    with pytest.raises(BadInput, match="does not answer"):
        Cluster()


def test_checks_are_the_same(nodes: Nodes, tmp_path: Path) -> None:
    few = ("--tasks", "LunchTime,GetDrink")
    for name in ("local", "far"):
        assert roboeval("evaluate", "recorded:careful", *few, "--out", name, cwd=tmp_path).status == 0
    local = roboeval("resample", "local", "--json", cwd=tmp_path)
    far = roboeval(
        *("resample", "far", "--json", "--engine", "ray"), cwd=tmp_path, environment=environment(nodes)
    )
    assert (far.status, json.loads(far.out)) == (0, json.loads(local.out)), far
    checks = [(tmp_path / name / "checks" / "paper.jsonl").read_bytes() for name in ("far", "local")]
    assert checks[0] == checks[1] != b""


@pytest.mark.usefixtures("nodes")
def test_keys_are_read_as_they_are_needed_and_equal_ones_are_one_call() -> None:
    read: list[int] = []

    def keys() -> Iterator[int]:
        for number in range(100_000):
            read.append(number)
            yield number % 3000

    with Cluster(2) as cluster:
        results = cluster.map_distinct(
            lambda _, key: (key, time.time_ns()), keys(), name=lambda key: str(key).encode(), then=tuple
        )
        first = [next(results) for _ in range(50)]
        assert [key for key, _ in first] == list(range(50))
        assert len(read) <= 50 + MOST_AHEAD
        more = [next(results) for _ in range(6000)]
        del results
    assert more[2950:3000] == first  # the very same calls
    assert len(read) <= 6050 + MOST_AHEAD


@pytest.mark.usefixtures("nodes")
def test_what_a_call_throws_is_thrown_here() -> None:
    def broken(_lane: Lane, key: int) -> int:
        return 1 // (key - 1)

    with Cluster() as cluster:
        results = cluster.map_distinct(broken, [0, 1], name=lambda key: str(key).encode(), then=abs)
        with pytest.raises(ZeroDivisionError):
            list(results)


@pytest.mark.usefixtures("nodes")
def test_who_wants_no_more_results_harms_nothing() -> None:
    with Cluster() as cluster:
        for number in range(40):  # a shard that was cancelled when just done would abort this process soon
            results = cluster.map_distinct(
                lambda _, key: key, range(500), name=lambda key: b"%d" % key, then=abs
            )
            assert [next(results) for _ in range(number + 1)] == [*range(number + 1)]
            del results


def test_a_node_that_is_killed_in_the_middle_loses_nothing(nodes: Nodes, paper: Suite) -> None:
    completions = list(recorded_completions("recorded:hasty", paper))
    here = list(evaluate(completions, paper, engine=Local(2)))
    with Cluster() as cluster:
        assert cluster._cores() == 2
        there: list[Row] = []
        for row in evaluate(completions, paper, engine=Same(cluster)):
            there.append(row)
            if len(there) == 20:
                nodes.kill()
        assert there == here
        end = time.monotonic() + 60
        while cluster._cores() > 1:  # until the head has noticed that it is gone
            assert time.monotonic() < end
            time.sleep(0.5)


class Same:
    """A cluster that is open already."""

    def __init__(self, cluster: Cluster) -> None:
        self.cluster = cluster

    def __enter__(self) -> Cluster:
        return self.cluster

    def __exit__(self, *_: object) -> None:
        pass


def test_a_cluster_without_a_core_ends_with_a_sentence(nodes: Nodes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rayengine, "PATIENCE", 1)
    nodes.kill()
    with Cluster() as cluster:
        results = cluster.map_distinct(
            lambda _, key: key, [1, 2], name=lambda key: str(key).encode(), then=abs
        )
        with pytest.raises(EngineError, match="no core"):
            list(results)
