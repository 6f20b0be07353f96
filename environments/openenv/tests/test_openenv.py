"""Test the real server with the package's own client."""

from __future__ import annotations

import asyncio
import json
import os
import re
import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr
from multiprocessing import get_context
from multiprocessing.context import ForkProcess
from pathlib import Path
from typing import Any, NamedTuple

import httpx
import pytest
from codebotler_openenv import CodebotlerAction, CodebotlerEnv, CodebotlerObservation, CodebotlerState
from codebotler_openenv.environment import SEEDS
from codebotler_openenv.server import main
from openenv.cli.__main__ import app as openenv_app
from openenv.core.client_types import StepResult
from openenv.core.sync_client import SyncEnvClient
from openenv.validation.graders.runtime import basic
from openenv.validation.manifest import NormalizedManifestV2
from openenv.validation.parsers.openenv_yaml import OpenEnvYamlParser
from openenv.validation.runtime.collector import collect_runtime_evidence
from openenv.validation.runtime.contracts import load_runtime_plan
from typer.testing import CliRunner

from codebotler.simulator.pool import shared_pool
from roboeval.suites.families.suite import FIRST_SEEDS
from roboeval.suites.families.tasks import family_file, family_names, trained_task
from roboeval.training.missions import TrainingMission, load_missions
from roboeval.training.prompts import load_prompts
from roboeval.training.rollouts import Rollout, judge

PACKAGE = Path(__file__).parents[1]
IDLE = "def task_program():\n    pass\n"
FOR_EVER = "def task_program():\n    while True:\n        pass\n"


class Urls(NamedTuple):
    usual: str
    for_one_session: str
    without_engine: str


@pytest.fixture(scope="session", autouse=True)
def urls() -> Iterator[Urls]:
    """Start servers in processes of their own, forked while there is no thread: they import nothing anew."""
    with (
        start_server() as usual,
        start_server("--sessions", "1") as for_one_session,
        start_server(stop_engine=True) as without_engine,
    ):
        yield Urls(*[wait_until_healthy(*one) for one in (usual, for_one_session, without_engine)])


@pytest.fixture
def url(urls: Urls) -> str:
    return urls.usual


@contextmanager
def start_server(*options: str, stop_engine: bool = False) -> Iterator[tuple[str, ForkProcess]]:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    arguments = (stop_engine, "--port", str(port), *options)
    server = get_context("fork").Process(target=be_server, args=arguments)
    server.start()
    try:
        yield f"http://127.0.0.1:{port}", server
    finally:
        server.terminate()
        server.join(20)


def be_server(stop_engine: bool, *arguments: str) -> None:  # noqa: FBT001 - a process passes it on
    sys.argv = ["codebotler-openenv", *arguments]
    if stop_engine:
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # One processor means one worker to stop.
        shared_pool().submit(lambda: shared_pool().here().stop()).result()
    with Path(os.devnull).open("w") as nothing, redirect_stderr(nothing):
        main()


def wait_until_healthy(url: str, server: ForkProcess) -> str:
    until = time.monotonic() + 60
    while time.monotonic() < until and server.is_alive():
        try:
            httpx.get(f"{url}/health", timeout=5).raise_for_status()
        except httpx.TransportError:
            time.sleep(0.1)
        else:
            return url
    raise AssertionError(f"the server did not start: {server.exitcode}")


Session = SyncEnvClient[CodebotlerAction, CodebotlerObservation, Any]
Result = StepResult[CodebotlerObservation]


@pytest.fixture
def session(url: str) -> Iterator[Session]:
    with CodebotlerEnv(url).sync() as session:
        yield session


def solution(session: Session) -> str:
    state = session.state()
    return trained_task(state.family, state.seed).solution


# --- prompts


@pytest.mark.parametrize("split", FIRST_SEEDS)
def test_a_reset_gives_the_prompt_of_load_prompts(session: Session, split: str) -> None:
    result = session.reset(seed=5, split=split)
    (row,) = load_prompts(split, count=1, seed=5)
    assert [message.model_dump() for message in result.observation.messages] == row["prompt"]
    assert result.observation.instruction == row["prompt"][-1]["content"]
    assert (result.reward, result.done, result.observation.components) == (None, False, None)
    state = session.state()
    assert (state.split, state.family, state.seed) == (split, row["family"], row["seed"])
    assert (state.prompt_index, state.step_count) == (row["prompt_index"], 0)


def test_a_reset_takes_a_family_and_an_episode_and_draws_a_random_task(session: Session) -> None:
    seeds = set()
    for _ in range(3):
        session.reset(family="BringThing", episode_id="mine")
        state = session.state()
        assert (state.family, state.episode_id, state.split) == ("BringThing", "mine", "train")
        assert 0 <= state.seed < SEEDS
        seeds.add(state.seed)
    assert len(seeds) == 3


# --- rewards


def test_the_reference_solution_earns_1_as_a_program_and_as_a_completion(session: Session) -> None:
    for family in family_names()[:3]:
        session.reset(seed=3, family=family)
        program = solution(session)
        assert_passes(session.step(CodebotlerAction(program=program)))
        session.reset(seed=3, family=family)
        assert_passes(session.step(CodebotlerAction(completion=f"Here it is:\n```python\n{program}```")))
        assert session.state().step_count == 1


def assert_passes(result: Result) -> None:
    assert (result.reward, result.done) == (1.0, True)
    found = result.observation.components
    assert found is not None
    assert {found.reward, found.passed, found.requirements, found.parses, found.rules_kept} == {1.0}


@pytest.mark.parametrize(
    "action", [{"program": ""}, {"completion": ""}, {"program": IDLE}, {"completion": "No."}]
)
def test_an_action_that_does_nothing_earns_0(session: Session, action: dict[str, Any]) -> None:
    session.reset(seed=3)
    result = session.step(CodebotlerAction(**action))
    assert (result.reward, result.done) == (0.0, True)


def test_rewards_are_those_of_the_library(session: Session) -> None:
    session.reset(seed=11, family="BringThing")
    state = session.state()
    program = trained_task(state.family, state.seed).wrong[0].program
    result = session.step(CodebotlerAction(program=program))
    (expected,) = judge([Rollout(state.family, state.seed, state.prompt_index, program)])
    assert result.observation.components == expected
    assert result.reward == expected.reward < 1


# --- missions of agents


def right_calls(state: CodebotlerState) -> list[tuple[str, dict[str, Any]]]:
    assert state.family is not None
    assert state.seed is not None
    program = trained_task(state.family, state.seed).solution
    rooms, message = re.findall(r"\[.*\]", program)[0], re.findall(r'say\("(.*)"\)', program)[0]
    each = [(("go_to", {"location": room}), ("say", {"message": message})) for room in json.loads(rooms)]
    return [call for calls in each for call in calls]


def begin_mission(session: Session, seed: int = 5) -> tuple[TrainingMission, list[CodebotlerAction]]:
    """Begin a mission, and return it with the calls that carry it out."""
    session.reset(seed=seed, family="AnnounceInOrder", mode="agent")
    (row,) = load_missions(count=1, seed=seed, only=["AnnounceInOrder"])
    calls = right_calls(session.state())
    return TrainingMission.begin(row), [CodebotlerAction(tool=name, arguments=given) for name, given in calls]


def test_a_mission_begins_with_its_prompt_and_its_tools(session: Session) -> None:
    found = session.reset(seed=5, split="test", mode="agent")
    (row,) = load_missions("test", count=1, seed=5)
    assert [message.model_dump() for message in found.observation.messages] == row["prompt"]
    assert found.observation.tools == row["tools"]
    assert (found.reward, found.done) == (None, False)
    state = session.state()
    assert (state.mode, state.seed, state.world) == ("agent", row["seed"], row["world"])


def test_each_step_is_a_call_and_the_answer_ends_the_mission(session: Session) -> None:
    mission, actions = begin_mission(session)
    asked = CodebotlerAction(tool="get_all_rooms", arguments="{}")
    for action in (asked, CodebotlerAction(tool="say", arguments="no JSON"), *actions):
        result = session.step(action)
        assert (result.reward, result.done, result.observation.components) == (None, False, None)
        assert action.tool is not None
        assert result.observation.result == mission.call(action.tool, action.arguments)
    result = session.step(CodebotlerAction(answer="Done."))
    assert (result.reward, result.done) == (1.0, True)
    assert result.observation.components == mission.components
    assert session.state().step_count == len(actions) + 3


def test_a_mission_may_end_with_a_call(session: Session) -> None:
    mission, actions = begin_mission(session)
    session.step(actions[0])
    mission.call("go_to", actions[0].arguments)
    result = session.step(CodebotlerAction(tool="give_up", arguments={"reason": "?"}))
    mission.call("give_up", {"reason": "?"})
    assert result.done
    assert result.observation.components == mission.components
    with pytest.raises(RuntimeError, match="this mission is over"):
        session.step(actions[1])


def test_an_action_of_the_other_mode_is_refused_and_the_mission_continues(session: Session) -> None:
    begin_mission(session)
    for wrong in (CodebotlerAction(program=""), CodebotlerAction(tool="say", answer="")):
        with pytest.raises(RuntimeError, match="either a tool or an answer"):
            session.step(wrong)
    assert session.step(CodebotlerAction(answer="")).reward == 0
    session.reset(seed=1)
    with pytest.raises(RuntimeError, match="either a completion or a program"):
        session.step(CodebotlerAction(answer=""))


def test_a_wrong_reset_leaves_no_mission(session: Session) -> None:
    begin_mission(session)
    with pytest.raises(RuntimeError, match="chess"):
        session.reset(mode="chess")
    with pytest.raises(RuntimeError, match="call reset before step"):
        session.step(CodebotlerAction(program=""))


# --- sessions


def test_concurrent_sessions_keep_their_own_tasks(url: str) -> None:
    async def rewards() -> list[float]:
        clients = [CodebotlerEnv(url) for _ in range(6)]
        try:
            await asyncio.gather(*(client.reset(seed=seed) for seed, client in enumerate(clients)))
            states = await asyncio.gather(*(client.state() for client in clients))
            programs = [trained_task(state.family, state.seed).solution for state in states]
            assert len(set(programs)) == len(clients)
            steps = zip(clients, programs, strict=True)
            results = await asyncio.gather(*(one.step(CodebotlerAction(program=text)) for one, text in steps))
            return [result.reward for result in results]
        finally:
            await asyncio.gather(*(client.close() for client in clients))

    assert asyncio.run(rewards()) == [1.0] * 6


def test_a_session_judges_its_own_task_and_not_that_of_another(url: str) -> None:
    with CodebotlerEnv(url).sync() as one, CodebotlerEnv(url).sync() as other:
        one.reset(seed=1, family="BringThing")
        other.reset(seed=2, family="BringThing")
        mine = solution(one)
        reward = other.step(CodebotlerAction(program=mine)).reward
        assert reward is not None
        assert reward < 1
        assert one.step(CodebotlerAction(program=mine)).reward == 1


def test_the_server_answers_while_it_judges(session: Session, url: str) -> None:
    session.reset(seed=4)
    results: list[Result] = []
    judging = threading.Thread(
        target=lambda: results.append(session.step(CodebotlerAction(program=FOR_EVER)))
    )
    began = time.monotonic()
    judging.start()
    delays = []
    while judging.is_alive():
        asked = time.monotonic()
        httpx.get(f"{url}/health", timeout=10).raise_for_status()
        delays.append(time.monotonic() - asked)
    judging.join()
    took = time.monotonic() - began
    assert [result.reward for result in results] == [0.0]
    assert len(delays) > 3
    assert max(delays) < max(1.0, took / 2)


def test_more_sessions_than_allowed_are_refused(urls: Urls) -> None:
    with CodebotlerEnv(urls.for_one_session).sync() as first:
        first.reset(seed=1)
        with (
            pytest.raises(RuntimeError, match="CAPACITY_REACHED"),
            CodebotlerEnv(urls.for_one_session).sync() as second,
        ):
            second.reset(seed=1)
        assert first.step(CodebotlerAction(program=solution(first))).reward == 1


# --- errors


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"family": "NoSuchFamily"}, 'there is no family "NoSuchFamily"'),
        ({"family": str(family_file("BringThing"))}, "there is no family"),  # No file is read for a client.
        ({"split": "plus"}, 'unknown split "plus"'),
        ({"seed": -1}, "the seed is -1"),
        ({"seed": SEEDS}, "from 0 to 999,999,999"),
        ({"seed": "x"}, "the seed is 'x'"),
        ({"mode": "chess"}, 'there is no mode "chess"'),
        ({"famly": "BringThing"}, "but not famly"),
    ],
)
def test_a_wrong_reset_is_refused_and_leaves_no_task(
    session: Session, options: dict[str, Any], sentence: str
) -> None:
    session.reset(seed=1)
    with pytest.raises(RuntimeError, match=sentence):
        session.reset(**options)
    with pytest.raises(RuntimeError, match="call reset before step"):
        session.step(CodebotlerAction(program=""))


def test_steps_that_cannot_be_judged_are_refused(session: Session) -> None:
    with pytest.raises(RuntimeError, match="there is no task yet"):
        session.step(CodebotlerAction(program=""))
    session.reset(seed=1)
    for wrong in (CodebotlerAction(), CodebotlerAction(program="", completion="")):
        with pytest.raises(RuntimeError, match="either a completion or a program"):
            session.step(wrong)
    session.step(CodebotlerAction(program=""))
    with pytest.raises(RuntimeError, match="over after its one step"):
        session.step(CodebotlerAction(program=""))
    session.reset(seed=1)
    assert session.step(CodebotlerAction(program=solution(session))).reward == 1


def test_a_field_of_the_wrong_type_is_an_error_and_the_session_continues(session: Session) -> None:
    session.reset(seed=1)
    wrong = CodebotlerAction.model_construct(program=7)
    with (
        pytest.warns(UserWarning, match="Expected `str`"),
        pytest.raises(RuntimeError, match="VALIDATION_ERROR"),
    ):
        session.step(wrong)
    assert session.step(CodebotlerAction(program=solution(session))).reward == 1


def test_plain_http_says_why_it_cannot_judge(url: str) -> None:
    assert httpx.post(f"{url}/reset", json={"seed": 1}).json()["observation"]["instruction"]
    step = httpx.post(f"{url}/step", json={"action": {"program": ""}})
    assert step.status_code == 400
    assert "in the same session of /ws" in step.json()["detail"]


def test_a_failure_of_the_engine_is_an_error_and_no_reward(urls: Urls) -> None:
    with CodebotlerEnv(urls.without_engine).sync() as session:
        session.reset(seed=1)
        for _ in range(2):  # The episode continues.
            with pytest.raises(RuntimeError, match=r"EngineError: .*no reward"):
                session.step(CodebotlerAction(program=solution(session)))
        assert session.state().step_count == 0


def test_the_server_listens_only_on_this_machine(url: str) -> None:
    with pytest.raises(httpx.ConnectError):
        httpx.get(url.replace("127.0.0.1", "127.0.0.2") + "/health")


# --- checks of openenv


def validate_with_openenv(*arguments: str) -> dict[str, Any]:
    done = CliRunner().invoke(openenv_app, ["validate", *arguments, "--json"])
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert isinstance(report, dict)
    return report


def test_openenv_validates_the_package() -> None:
    assert validate_with_openenv(str(PACKAGE), "--level", "static")["verdict"] == "pass"


def test_openenv_validates_the_running_server(url: str) -> None:
    report = validate_with_openenv("--url", url)
    assert report["passed"]
    assert report["mode"] == "simulation"


def test_an_episode_fits_the_manifest(url: str) -> None:
    """Repeat the checks that `openenv validate --level runtime` makes in a container."""
    manifest = OpenEnvYamlParser().parse(PACKAGE)
    assert isinstance(manifest, NormalizedManifestV2)
    plan = load_runtime_plan(PACKAGE, manifest.execution)
    evidence = collect_runtime_evidence(url, plan, episode_timeout_s=manifest.resources.episode_timeout_s)
    assert evidence.failure_reason is None
    subject = type("Subject", (), {"manifest": manifest, "runtime_evidence": evidence})
    graders = [basic.RewardWellFormedGrader(), basic.ObservationSchemaGrader(), basic.StateContractGrader()]
    assert [grader.run(subject).evidence for grader in graders] == [["observed runtime contract holds"]] * 3
    (step,) = [json.loads(one.response_json) for one in evidence.exchanges if one.operation == "step"]
    assert step["data"]["reward"] == 1
