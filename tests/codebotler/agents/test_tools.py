"""Agents call the tools through the SDK's own client; no tool approves, a person decides."""

from __future__ import annotations

import asyncio
import json
import logging
import threading
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import pytest
from mcp import Client, MCPError
from mcp.client.session import ClientRequestContext, ElicitationFnT
from mcp_types import ElicitRequestParams, ElicitResult

from codebotler.agents.gatekeeper import Gatekeeper
from codebotler.agents.reports import SkillOutcome
from codebotler.agents.server import make_server
from codebotler.agents.steps import Steps
from codebotler.checking.contracts.file import contract_from
from codebotler.checking.house_rules.file import read_rules
from codebotler.core.errors import UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.world import Room, World
from codebotler.missions.display.view import MissionOrder, SessionView, program_digest
from codebotler.missions.display.wording import event_text
from codebotler.missions.mission import BY_SHUTDOWN
from codebotler.missions.preflight import known_instructions
from codebotler.missions.session import MissionSession
from codebotler.missions.storage.log import MissionState, MissionSummary
from codebotler.missions.storage.store import RECENT_MISSIONS
from codebotler.models.base import Reply, TextListener, ignore_text
from codebotler.models.recorded import open_recorded
from codebotler.prompts import Prompt
from codebotler.robots.base import RobotLostError, RobotResult
from codebotler.robots.reservation import Reservation
from codebotler.robots.simulated import Simulated
from codebotler.rtl import parse
from codebotler.simulator.guard.house_rule import Rule
from codebotler.web.console import Console
from doubles import FakeModel, FakeRobot, fail_with
from ended import cut, failed_mission, line_of

WORLD = World((Room("hall"), Room("kitchen"), Room("vault")), "hall")
HELLO = "def task_program():\n    go_to('kitchen')\n    say('hello')\n"
QUIET = "def task_program():\n    go_to('kitchen')\n"
FAULTY = "def task_program():\n    go_to('cellar')\n"
FAR = "def task_program():\n    for _ in range(50):\n        go_to('kitchen')\n        go_to('hall')\n"
INTO_VAULT = "def task_program():\n    go_to('vault')\n"
STAY_OUT = Rule("vault", "Stay out of the vault.", parse('not tr.Exists(goto("vault"))'))
SOON = 30.0
MODES = pytest.mark.parametrize("mode", ["auto", "legacy"])


def gatekeeper_at(home: Path, *, speed: float | None = None, rules: tuple[Rule, ...] = ()) -> Gatekeeper:
    robot = Simulated(WORLD, speed=speed)
    return Gatekeeper(
        Console(robot, home, open_recorded, world=WORLD, rules=rules), page="http://localhost:1/"
    )


@pytest.fixture
def gatekeeper(tmp_path: Path) -> Iterator[Gatekeeper]:
    made = gatekeeper_at(tmp_path)
    with made.console:
        yield made


class Agent:
    """A client whose calls return structured results."""

    def __init__(self, client: Client) -> None:
        self.client = client

    async def call(self, tool: str, **arguments: Any) -> Any:  # noqa: ANN401 - any tool's result
        result = await self.client.call_tool(tool, arguments)
        assert not result.is_error, result.content
        return result.structured_content

    async def fails(self, tool: str, **arguments: Any) -> str:  # noqa: ANN401 - any tool's arguments
        result = await self.client.call_tool(tool, arguments)
        assert result.is_error, result.structured_content
        return getattr(result.content[0], "text", "")


def use(
    gatekeeper: Gatekeeper,
    act: Callable[[Agent], Coroutine[Any, Any, None]],
    *,
    answer: ElicitationFnT | None = None,
    mode: str = "auto",
) -> None:
    """Let an agent act through a client that may ask a person."""

    async def main() -> None:
        async with (
            asyncio.timeout(SOON),
            Client(make_server(gatekeeper), elicitation_callback=answer, mode=mode) as client,
        ):
            await act(Agent(client))

    asyncio.run(main())


def make_person(action: Any, *, approve: bool | None = None) -> tuple[ElicitationFnT, list[str]]:  # noqa: ANN401 - one of three words
    """Make a person who gives this answer, and the list of questions that were asked."""
    asked: list[str] = []

    async def answer(context: ClientRequestContext, params: ElicitRequestParams) -> ElicitResult:  # noqa: ARG001 - the SDK passes it
        asked.append(params.message)
        return ElicitResult(action=action, content=None if approve is None else {"approve": approve})

    return answer, asked


def view_of(gatekeeper: Gatekeeper) -> SessionView:
    return gatekeeper.console.view


def approve(gatekeeper: Gatekeeper) -> None:
    """Approve the current program, as a person does on the page."""
    session = gatekeeper.console.session
    assert session is not None
    session.approve(session.view.digest)


def session_of(gatekeeper: Gatekeeper) -> MissionSession:
    session = gatekeeper.console.session
    assert session is not None
    return session


async def wait_until(gatekeeper: Gatekeeper, holds: Callable[[SessionView], bool]) -> None:
    assert await gatekeeper.console.notifier.until(lambda: holds(view_of(gatekeeper)), SOON)


# --- reading and checking


@pytest.mark.slow
def test_an_agent_reads_the_robot_and_checks_programs(gatekeeper: Gatekeeper) -> None:
    async def act(agent: Agent) -> None:
        robot = await agent.call("read_robot")
        assert robot["rooms"] == ["hall", "kitchen", "vault"]
        assert "go_to(location: str) -> None" in robot["skills"]
        assert "def go_to" in robot["how_to_write"]
        good, bad = (
            await agent.call("check_program", program=HELLO),
            await agent.call("check_program", program="("),
        )
        assert good["accepted"]
        assert '- kitchen: "hello"\n' in good["storyboards"][0]
        assert (bad["accepted"], len(bad["problems"])) == (False, 1)
        assert gatekeeper.console.session is None

    use(gatekeeper, act)


def test_every_tool_has_a_description_and_typed_arguments_and_none_approves(gatekeeper: Gatekeeper) -> None:
    async def act(agent: Agent) -> None:
        tools = {tool.name: tool for tool in (await agent.client.list_tools()).tools}
        assert {*tools} == {
            *("read_robot", "check_program", "write_program", "propose_mission", "begin_steps"),
            "choose_behaviour",
            *("continue_mission", "run_mission", "follow_mission", "call_skill", "end_steps", "stop"),
        }
        for tool in tools.values():
            assert len(tool.description or "") > 60
            assert tool.output_schema
            for argument in tool.input_schema.get("properties", {}).values():
                assert argument.get("description")
        assert {*tools["run_mission"].input_schema["properties"]} == {"digest", "seconds"}

    use(gatekeeper, act)


@pytest.mark.slow
def test_writing_needs_a_model(gatekeeper: Gatekeeper) -> None:
    async def act(agent: Agent) -> None:
        assert "no model is configured" in await agent.fails("write_program", instruction="Say hello.")
        assert "no model is configured" in await agent.fails("propose_mission", instruction="Say hello.")
        gatekeeper.writes = True
        assert "has no program" in await agent.fails("write_program", instruction="Say hello.")
        known = next(iter(known_instructions(None)))
        written = await agent.call("write_program", instruction=known)
        assert "def task_program" in written["program"]
        assert gatekeeper.console.session is None
        proposed = await agent.call("propose_mission", instruction=known)
        assert "def task_program" in proposed["check"]["program"]

    use(gatekeeper, act)


@pytest.mark.slow
def test_lone_surrogates_do_not_keep_an_agent_from_stopping(gatekeeper: Gatekeeper) -> None:
    async def act(agent: Agent) -> None:
        program = "def task_program():\n    say('\\ud800')\n    raise ValueError('\\udfff')\n"
        assert "\\udfff" in (await agent.call("check_program", program=program))["problems"][0]
        await agent.call("propose_mission", program=program)
        assert (await agent.call("stop"))["state"] == "stopped"
        assert SkillOutcome(result=["\ud800"]).model_dump_json() == '{"result":["\\\\ud800"],"error":""}'

    use(gatekeeper, act)


def test_the_sdk_leaves_our_log_alone(gatekeeper: Gatekeeper) -> None:
    before = logging.root.handlers[:]
    make_server(gatekeeper)
    assert logging.root.handlers == before


# --- approval


@pytest.mark.slow
def test_nothing_runs_until_a_person_approves_on_the_page(gatekeeper: Gatekeeper) -> None:
    async def act(agent: Agent) -> None:
        proposed = await agent.call("propose_mission", instruction="say hello", program=HELLO)
        assert (proposed["state"], proposed["check"]["accepted"]) == ("checked", True)
        assert "http://localhost:1/" in proposed["next"]
        waiting = await agent.call("run_mission", digest=proposed["digest"], seconds=0.05)
        assert (waiting["state"], waiting["events"][-1], waiting["is_over"]) == (
            "checked",
            "checked: no problems",
            False,
        )
        running = asyncio.create_task(agent.call("run_mission", digest=proposed["digest"]))
        await asyncio.sleep(0.05)
        approve(gatekeeper)
        done = await running
        assert (done["state"], done["is_over"]) == ("done", True)
        assert 'says "hello"' in done["events"]
        assert "no mission is waiting" in await agent.fails("run_mission", digest=proposed["digest"])

    use(gatekeeper, act)


def test_agent_is_told_why_mission_did_not_begin(gatekeeper: Gatekeeper) -> None:
    async def act(agent: Agent) -> None:
        proposed = await agent.call("propose_mission", program=HELLO)
        assert (proposed["is_over"], proposed["mission"]) == (True, "")
        assert "another tool" in proposed["reason"]
        assert "another tool" in await agent.fails("run_mission", digest="0")

    with Reservation(gatekeeper.console.robot, gatekeeper.console.home):
        use(gatekeeper, act)


@pytest.mark.slow
def test_run_refuses_a_digest_of_another_program(gatekeeper: Gatekeeper) -> None:
    async def act(agent: Agent) -> None:
        first = await agent.call("propose_mission", program=HELLO)
        second = await agent.call("propose_mission", program=HELLO + "    say('bye')\n")
        assert first["digest"] != second["digest"]
        assert "another digest" in await agent.fails("run_mission", digest=first["digest"])
        gatekeeper.console.edit(HELLO + "    say('a person wrote this')\n")
        await wait_until(gatekeeper, lambda view: view.may_be_approved)
        assert "another digest" in await agent.fails("run_mission", digest=second["digest"])
        for wrong in ("", second["digest"][:-1], second["digest"].upper() + "é"):
            assert "another digest" in await agent.fails("run_mission", digest=wrong)
        assert not view_of(gatekeeper).progress.has_begun

    use(gatekeeper, act)


@pytest.mark.slow
@MODES
def test_a_person_accepts_in_the_clients_dialog(gatekeeper: Gatekeeper, mode: str) -> None:
    gatekeeper.asks_client = True
    answer, asked = make_person("accept", approve=True)

    async def act(agent: Agent) -> None:
        proposed = await agent.call("propose_mission", instruction="say hello", program=HELLO)
        done = await agent.call("run_mission", digest=proposed["digest"])
        assert done["state"] == "done"
        (question,) = asked
        assert proposed["digest"] in question
        assert proposed["mission"] in question
        assert all(line in question for line in HELLO.splitlines())
        assert "no problems" in question
        assert any("approved by a person, asked by" in event for event in done["events"])

    use(gatekeeper, act, answer=answer, mode=mode)


@MODES
@pytest.mark.parametrize(
    ("action", "ticked", "is_over"),
    [("decline", None, True), ("cancel", None, False), ("accept", False, True)],
)
def test_only_an_explicit_yes_approves(
    gatekeeper: Gatekeeper, mode: str, action: str, *, ticked: bool | None, is_over: bool
) -> None:
    gatekeeper.asks_client = True
    answer, asked = make_person(action, approve=ticked)

    async def act(agent: Agent) -> None:
        proposed = await agent.call("propose_mission", program=HELLO)
        answered = await agent.call("run_mission", digest=proposed["digest"], seconds=1 if is_over else 0.05)
        assert (answered["is_over"], answered["state"]) == (is_over, "stopped" if is_over else "checked")
        assert len(asked) == 1
        assert not view_of(gatekeeper).progress.has_begun

    use(gatekeeper, act, answer=answer, mode=mode)


@MODES
def test_an_accepted_form_without_content_does_not_approve(gatekeeper: Gatekeeper, mode: str) -> None:
    gatekeeper.asks_client = True
    answer, _ = make_person("accept")

    async def act(agent: Agent) -> None:
        proposed = await agent.call("propose_mission", program=HELLO)
        await agent.fails("run_mission", digest=proposed["digest"], seconds=0.05)
        assert view_of(gatekeeper).state is MissionState.CHECKED

    use(gatekeeper, act, answer=answer, mode=mode)


def test_a_client_is_not_asked_unless_the_operator_allows_it(gatekeeper: Gatekeeper) -> None:
    answer, asked = make_person("accept", approve=True)

    async def act(agent: Agent) -> None:
        proposed = await agent.call("propose_mission", program=HELLO)
        waiting = await agent.call("run_mission", digest=proposed["digest"], seconds=0.05)
        assert (waiting["state"], asked) == ("checked", [])

    use(gatekeeper, act, answer=answer)


@pytest.mark.slow
@MODES
def test_an_answer_does_not_approve_a_program_that_replaced_the_one_shown(
    gatekeeper: Gatekeeper, mode: str
) -> None:
    gatekeeper.asks_client = True
    asked: list[str] = []

    async def answer(context: ClientRequestContext, params: ElicitRequestParams) -> ElicitResult:  # noqa: ARG001 - the SDK passes it
        asked.append(params.message)
        gatekeeper.console.edit(FAR)
        await wait_until(gatekeeper, lambda view: view.may_be_approved and view.program == FAR)
        return ElicitResult(action="accept", content={"approve": True})

    async def act(agent: Agent) -> None:
        proposed = await agent.call("propose_mission", program=HELLO)
        await agent.fails("run_mission", digest=proposed["digest"], seconds=0.05)
        assert (view_of(gatekeeper).state, len(asked)) == (MissionState.CHECKED, 1)

    use(gatekeeper, act, answer=answer, mode=mode)


def test_a_program_too_long_for_a_dialog_is_approved_on_the_page_only(gatekeeper: Gatekeeper) -> None:
    gatekeeper.asks_client = True
    answer, asked = make_person("accept", approve=True)

    async def act(agent: Agent) -> None:
        far = (
            f"def task_program():\n    for one in ['a', 'b', 'c', 'd']:\n        say(one + '{'x' * 1_500}')\n"
        )
        for program in (HELLO + "#" * 4_000, far):
            proposed = await agent.call("propose_mission", program=program)
            waiting = await agent.call("run_mission", digest=proposed["digest"], seconds=0.05)
            assert (waiting["state"], asked) == ("checked", [])

    use(gatekeeper, act, answer=answer)


def test_the_dialog_names_each_room_that_a_program_may_enter(gatekeeper: Gatekeeper) -> None:
    names = [f"room {number}" for number in range(20)]
    drives = "".join(f"    go_to('{name}')\n" for name in names)
    check = gatekeeper.check(f"def task_program():\n{drives}")
    assert all(f'"{name}"' in check.contract for name in names)


def test_problems_are_shown_to_the_person_and_a_contract_never_approves_them(gatekeeper: Gatekeeper) -> None:
    gatekeeper.console.within = contract_from(allow_all(), SKILLS)
    answer, asked = make_person("cancel")

    async def act(agent: Agent) -> None:
        proposed = await agent.call("propose_mission", program=FAULTY)
        assert not proposed["check"]["accepted"]
        waiting = await agent.call("run_mission", digest=proposed["digest"], seconds=0.05)
        assert waiting["state"] == "checked"
        gatekeeper.asks_client = True
        await agent.call("run_mission", digest=proposed["digest"], seconds=0.05)
        assert "PROBLEMS" in asked[0].split("\n\n")[1], "problems come before the agent's own text"
        assert "cellar" in asked[0]
        broken = await agent.call("propose_mission", program="(")
        await agent.call("run_mission", digest=broken["digest"], seconds=0.05)
        assert len(asked) == 1

    use(gatekeeper, act, answer=answer)


@pytest.mark.slow
def test_a_contract_given_at_the_start_approves(gatekeeper: Gatekeeper) -> None:
    allowed = allow_all("say") | {"go_to": {"location": ["kitchen"]}}
    gatekeeper.console.within = contract_from(allowed, SKILLS)

    async def act(agent: Agent) -> None:
        proposed = await agent.call("propose_mission", program=HELLO)
        done = await agent.call("run_mission", digest=proposed["digest"])
        assert done["state"] == "done"
        assert 'approved by the contract given at the start, for agent "mcp"' in done["events"]
        other = await agent.call("propose_mission", program=FAR)
        waiting = await agent.call("run_mission", digest=other["digest"], seconds=0.05)
        assert waiting["state"] == "checked"

    use(gatekeeper, act)


# --- one robot, several agents and a person


@pytest.mark.slow
def test_an_agent_neither_replaces_a_persons_mission_nor_runs_a_second_one(tmp_path: Path) -> None:
    gatekeeper = gatekeeper_at(tmp_path, speed=1.0)

    async def act(agent: Agent) -> None:
        gatekeeper.console.begin(MissionOrder(program=FAR))
        await wait_until(gatekeeper, lambda view: view.may_be_approved)
        mine = view_of(gatekeeper).id
        assert "a person is working" in await agent.fails("propose_mission", program=HELLO)
        approve(gatekeeper)
        await wait_until(gatekeeper, lambda view: view.is_running)
        await agent.fails("propose_mission", program=HELLO)
        assert (view_of(gatekeeper).id, view_of(gatekeeper).is_running) == (mine, True)
        stopped = await agent.call("stop")
        assert (stopped["mission"], stopped["state"]) == (mine, "stopped")
        proposed = await agent.call("propose_mission", program=FAR)
        running = asyncio.create_task(agent.call("run_mission", digest=proposed["digest"]))
        approve(gatekeeper)
        await wait_until(gatekeeper, lambda view: view.is_running)
        assert "stop it first" in await agent.fails("propose_mission", program=HELLO)
        await agent.call("stop")
        await running

    with gatekeeper.console:
        use(gatekeeper, act)


@pytest.mark.slow
def test_a_second_client_stops_while_the_first_waits_and_sees_progress(tmp_path: Path) -> None:
    gatekeeper = gatekeeper_at(tmp_path, speed=1.0)

    async def act(agent: Agent) -> None:
        said: list[str] = []

        async def hear(progress: float, total: float | None, message: str | None) -> None:  # noqa: ARG001 - the SDK passes it
            said.append(message or "")

        proposed = await agent.call("propose_mission", program=FAR)
        arguments = {"digest": proposed["digest"]}
        running = asyncio.create_task(
            agent.client.call_tool("run_mission", arguments, progress_callback=hear)
        )
        approve(gatekeeper)
        await wait_until(gatekeeper, lambda view: view.is_running and view.progress.is_driving)
        async with Client(make_server(gatekeeper)) as other:
            stopped = await Agent(other).call("stop")
        ended = (await running).structured_content
        assert ended is not None
        assert (stopped["state"], ended["state"], ended["is_over"]) == ("stopped", "stopped", True)
        assert 'drives to "kitchen"' in said

    with gatekeeper.console:
        use(gatekeeper, act)


@pytest.mark.slow
@MODES
def test_the_robot_stops_if_the_call_is_cancelled(tmp_path: Path, mode: str) -> None:
    gatekeeper = gatekeeper_at(tmp_path, speed=1.0)

    async def act(agent: Agent) -> None:
        proposed = await agent.call("propose_mission", program=FAR)
        running = asyncio.create_task(agent.call("run_mission", digest=proposed["digest"]))
        await asyncio.sleep(0.05)
        approve(gatekeeper)
        await wait_until(gatekeeper, lambda view: view.is_running)
        running.cancel()
        await wait_until(gatekeeper, lambda view: view.is_over)
        assert view_of(gatekeeper).state is MissionState.STOPPED
        assert "cancelled" in view_of(gatekeeper).reason

    with gatekeeper.console:
        use(gatekeeper, act, mode=mode)


def test_missions_and_their_logs_are_resources(gatekeeper: Gatekeeper) -> None:
    async def act(agent: Agent) -> None:
        proposed = await agent.call("propose_mission", program=HELLO)
        await agent.call("stop")
        listed = await read(agent, "codebotler://missions")
        assert [(one["id"], "program" in one) for one in json.loads(listed)] == [(proposed["mission"], False)]
        one = f"codebotler://missions/{proposed['mission']}"
        assert json.loads(await read(agent, one))["program"] == HELLO
        log = [json.loads(line) for line in (await read(agent, f"{one}/log")).splitlines()]
        assert log[-1]["state"] == "stopped"
        for wrong in ("20200101-000000", "..%2F..%2Fsecret", "20200101-000000%2Flog"):
            with pytest.raises(Exception, match=r"no mission|not found|Unknown|rejected"):
                await read(agent, f"codebotler://missions/{wrong}")

    use(gatekeeper, act)


@pytest.mark.parametrize(
    "what", ["codebotler://missions", "codebotler://missions/last/log", "continue_mission"]
)
def test_one_call_at_a_time_reads_past_missions_and_only_recent_ones(
    gatekeeper: Gatekeeper, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    begun, go_on, asked = threading.Event(), threading.Event(), list[int | None]()

    def slowly(home: Path, most: int | None = None) -> list[MissionSummary]:  # noqa: ARG001 - its caller passes it
        asked.append(most)
        begun.set()
        go_on.wait(SOON)
        return []

    for module in ("agents.server", "missions.storage.store"):
        monkeypatch.setattr(f"codebotler.{module}.read_missions", slowly)

    async def act(agent: Agent) -> None:
        async def ask() -> str:
            try:
                return await (agent.fails(what) if what == "continue_mission" else read(agent, what))
            except MCPError as error:
                return str(error)

        asyncio.get_running_loop().set_default_executor(ThreadPoolExecutor(1))
        first = asyncio.ensure_future(ask())
        try:
            assert await asyncio.to_thread(begun.wait, SOON)
            assert "another reading" in await ask()
            assert await asyncio.wait_for(asyncio.to_thread(begun.is_set), 1.0), "the thread pool stays free"
        finally:
            go_on.set()
        assert "another reading" not in await first

    use(gatekeeper, act)
    assert asked == [RECENT_MISSIONS]


def test_too_long_resources_are_refused(gatekeeper: Gatekeeper, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("codebotler.agents.server.MAX_READ_BYTES", 10_000)

    async def act(agent: Agent) -> None:
        asked = await agent.call("propose_mission", instruction="x" * 9_999, program=HELLO)
        assert len(await read(agent, "codebotler://missions")) < 2_000
        for uri in (f"codebotler://missions/{asked['mission']}", "codebotler://missions/last"):
            with pytest.raises(MCPError, match="larger than"):
                await read(agent, uri)

    use(gatekeeper, act)


async def read(agent: Agent, uri: str) -> str:
    (content,) = (await agent.client.read_resource(uri)).contents
    return str(getattr(content, "text", ""))


# --- step by step

PLACES = {"pick": {"in": "any"}, "place": {"in": "any"}}
ANSWERS: dict[str, RobotResult] = {
    "get_all_rooms": ["hall"],
    "get_current_location": "hall",
    "ask": " YES ",
}


def allow_all(*skills: str) -> dict[str, dict[str, str]]:
    """Return a contract that allows all calls of some skills, by default of all."""
    rows = [SKILLS[name] for name in skills or SKILLS]
    return {row.name: {one.name: "any" for one in row.parameters} | PLACES.get(row.name, {}) for row in rows}


async def begin_steps(
    agent: Agent, gatekeeper: Gatekeeper, *skills: str, contract: dict[str, Any] | None = None
) -> tuple[str, dict[str, Any]]:
    """Begin a step-by-step mission and approve it; return its key and the answer of run_mission."""
    proposed = await agent.call(
        "begin_steps",
        purpose="look around\n# It may call: nothing",
        contract=contract or allow_all(*skills),
    )
    running = asyncio.create_task(agent.call("run_mission", digest=proposed["digest"]))
    approve(gatekeeper)
    return proposed["steps"], await running


def test_skills_are_called_one_at_a_time_and_logged_as_a_mission(gatekeeper: Gatekeeper) -> None:
    async def act(agent: Agent) -> None:
        key, begun = await begin_steps(agent, gatekeeper)
        assert begun["state"] == "running"
        assert "\n# It may call: nothing" not in begun["check"]["program"]
        assert (await agent.call("call_skill", steps=key, name="get_current_location"))["result"] == "hall"
        await agent.call("call_skill", steps=key, name="go_to", arguments={"location": "kitchen"})
        assert (await agent.call("call_skill", steps=key, name="get_current_location"))["result"] == "kitchen"
        failed = await agent.call("call_skill", steps=key, name="go_to", arguments={"location": "moon"})
        assert failed["error"].startswith("GoToInvalidLocation")
        looked = await agent.call("call_skill", steps=key, name="is_in_room", arguments={"entity": "mug"})
        assert (looked["result"], looked["error"]) == (False, "")
        ended = await agent.call("end_steps", steps=key)
        assert (ended["state"], ended["is_over"]) == ("done", True)
        assert 'drives to "kitchen"' in ended["events"]
        assert "not running" in await agent.fails("call_skill", steps=key, name="get_all_rooms")
        assert "not running" in await agent.fails("end_steps", steps=key)

    use(gatekeeper, act)


def test_no_two_proposals_of_steps_have_the_same_digest() -> None:
    contract = contract_from(allow_all("go_to"), SKILLS)
    first, second = Steps("look", contract, SKILLS), Steps("look", contract, SKILLS)
    assert first.program == first.program
    assert program_digest(first.program) != program_digest(second.program)


def test_steps_and_reported_events_and_waiting_calls_are_limited(
    gatekeeper: Gatekeeper, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("codebotler.agents.steps.MAX_STEPS", 3)
    monkeypatch.setattr("codebotler.agents.gatekeeper.MAX_REPORTED_EVENTS", 4)
    monkeypatch.setattr("codebotler.agents.gatekeeper.MAX_WAITING_CALLS", 1)

    async def act(agent: Agent) -> None:
        key, _ = await begin_steps(agent, gatekeeper)
        with gatekeeper.waiting():
            for tool, given in (
                ("follow_mission", {}),
                ("propose_mission", {"program": HELLO}),
                ("call_skill", {"steps": key, "name": "get_all_rooms"}),
            ):
                assert "are waiting" in await agent.fails(tool, **given)
        for _ in range(3):
            await agent.call("call_skill", steps=key, name="get_all_rooms")
        await wait_until(gatekeeper, lambda view: view.is_over)
        ended = await agent.call("follow_mission")
        assert (ended["state"], "3 calls" in ended["reason"]) == ("failed", True)
        assert "not running" in await agent.fails("call_skill", steps=key, name="get_all_rooms")
        parts, after = list[list[str]](), 0
        while (part := await agent.call("follow_mission", after=after))["event_count"] > after:
            after = part["event_count"]
            parts.append(part["events"])
        assert max(map(len, parts)) == 4
        session = gatekeeper.console.session
        assert session is not None
        assert [*chain(*parts)] == [text for text in map(event_text, session.events()) if text]

    use(gatekeeper, act)


def test_invalid_calls_do_not_reach_the_robot(gatekeeper: Gatekeeper) -> None:
    async def act(agent: Agent) -> None:
        assert 'no skill "fly"' in await agent.fails("begin_steps", purpose="fly", contract={"fly": {}})
        assert 'no key "text"' in await agent.fails(
            "begin_steps", purpose="a", contract={"say": {"text": "any"}}
        )
        key, _ = await begin_steps(agent, gatekeeper, "go_to", "ask")
        for wrong in ({}, {"location": 3}, {"location": ["kitchen"]}, {"location": "kitchen", "more": 1}):
            assert "go_to" in await agent.fails("call_skill", steps=key, name="go_to", arguments=wrong)
        far = {"location": ["kitchen"] * 2_000}
        assert "shorten" in await agent.fails("call_skill", steps=key, name="go_to", arguments=far)
        assert "may call only" in await agent.fails(
            "call_skill", steps=key, name="say", arguments={"message": "a"}
        )
        arguments = {"location": "kitchen"}
        assert "no step-by-step" in await agent.fails(
            "call_skill", steps="x", name="go_to", arguments=arguments
        )
        session = gatekeeper.console.session
        assert session is not None
        assert [line for line in session.events() if line["event"] == "skill"] == []
        stopped = await agent.call("stop")
        assert (stopped["state"], stopped["is_over"]) == ("stopped", True)

    use(gatekeeper, act)


def test_a_question_is_asked_and_its_answer_is_one_of_the_options(tmp_path: Path) -> None:
    robot = FakeRobot(lambda skill, _: ANSWERS.get(skill))
    gatekeeper = Gatekeeper(Console(robot, tmp_path, open_recorded))

    async def act(agent: Agent) -> None:
        key, _ = await begin_steps(agent, gatekeeper, "ask")
        question = {"person": "", "question": "Tea?", "options": ["no", "yes"]}
        assert (await agent.call("call_skill", steps=key, name="ask", arguments=question))["result"] == "yes"
        failed = await agent.call("call_skill", steps=key, name="ask", arguments=question | {"options": []})
        assert failed["error"].startswith("AskEmptyOptions")
        for wrong in ("yes", None, 3):
            await agent.fails("call_skill", steps=key, name="ask", arguments=question | {"options": wrong})
        await agent.call("stop")

    with gatekeeper.console:
        use(gatekeeper, act)


def test_a_robot_that_is_lost_ends_the_steps(tmp_path: Path) -> None:
    robot = FakeRobot(lambda skill, _: ANSWERS.get(skill))
    gatekeeper = Gatekeeper(Console(robot, tmp_path, open_recorded))

    async def act(agent: Agent) -> None:
        key, _ = await begin_steps(agent, gatekeeper)
        robot.answer = fail_with(RobotLostError("its battery is empty"))
        assert "ended" in await agent.fails("call_skill", steps=key, name="say", arguments={"message": "a"})
        await wait_until(gatekeeper, lambda view: view.is_over)
        report = await agent.call("follow_mission")
        assert (report["state"], "battery" in report["reason"]) == ("failed", True)

    with gatekeeper.console:
        use(gatekeeper, act)


def test_an_agents_stop_says_if_another_process_uses_the_robot(gatekeeper: Gatekeeper) -> None:
    async def act(agent: Agent) -> None:
        assert "NOT STOPPED" in (await agent.call("stop"))["next"]

    with Reservation(gatekeeper.console.robot, gatekeeper.console.home):
        use(gatekeeper, act)


def test_after_a_loss_the_agent_and_its_person_are_warned(tmp_path: Path) -> None:
    robot = FakeRobot(lambda skill, _: ANSWERS.get(skill))
    gatekeeper = Gatekeeper(Console(robot, tmp_path, open_recorded), asks_client=True)
    answer, asked = make_person("cancel")

    talk = "def task_program():\n    say('a')\n"

    async def act(agent: Agent) -> None:
        session = gatekeeper.console.begin(MissionOrder(program=talk))
        await wait_until(gatekeeper, lambda view: view.may_be_approved)
        robot.answer = fail_with(RobotLostError("its battery is empty"))
        session.approve(session.view.digest)
        await wait_until(gatekeeper, lambda view: view.is_over)
        await asyncio.to_thread(session.join, SOON)
        robot.answer = lambda skill, _: ANSWERS.get(skill)
        proposed = await agent.call("propose_mission", program=talk)
        assert any("battery" in remark for remark in proposed["remarks"])
        await agent.call("run_mission", digest=proposed["digest"], seconds=0.05)
        assert "battery" in asked[0].splitlines()[0]
        assert "contract again" in asked[0]
        stopped = await agent.call("stop")
        assert any("battery" in remark for remark in stopped["remarks"])

    with gatekeeper.console:
        use(gatekeeper, act, answer=answer)


def test_steps_beyond_the_contract_of_the_start_need_a_person(gatekeeper: Gatekeeper) -> None:
    gatekeeper.console.within, gatekeeper.asks_client = contract_from(allow_all("say"), SKILLS), True
    answer, asked = make_person("cancel")

    async def act(agent: Agent) -> None:
        proposed = await agent.call("begin_steps", purpose="look around", contract=allow_all("say", "go_to"))
        waiting = await agent.call("run_mission", digest=proposed["digest"], seconds=0.05)
        assert (waiting["state"], len(asked)) == ("checked", 1)
        assert "OutsideContract" in asked[0]
        assert "For example" not in asked[0]
        proposed = await agent.call(
            "begin_steps", purpose="talk", contract={"say": {"message": ["hello {}"]}}
        )
        running = await agent.call("run_mission", digest=proposed["digest"])
        assert (running["state"], len(asked)) == ("running", 1)
        await agent.call(
            "call_skill", steps=proposed["steps"], name="say", arguments={"message": "hello Ann"}
        )
        await agent.fails("call_skill", steps=proposed["steps"], name="say", arguments={"message": "bye"})
        ended = await agent.call("follow_mission")
        assert (ended["state"], ended["reason"]) == ("stopped", "stopped by rule approved contract")

    use(gatekeeper, act, answer=answer)


@pytest.mark.parametrize("change", ["edit", "rule"])
def test_a_contract_approves_nothing_that_a_person_has_changed(tmp_path: Path, change: str) -> None:
    (tmp_path / "house.yaml").write_text(
        "rules: [{name: vault, says: Stay out of the vault., always: 'not tr.Exists(goto(\"vault\"))'}]\n"
    )
    gatekeeper = gatekeeper_at(tmp_path, rules=tuple(read_rules(tmp_path / "house.yaml")))
    gatekeeper.console.within = contract_from(allow_all(), SKILLS)

    async def act(agent: Agent) -> None:
        proposed = await agent.call("propose_mission", program=HELLO)
        session = gatekeeper.console.session
        assert session is not None
        if change == "edit":
            session.edit(HELLO.replace("hello", "bye"))
        else:
            session.switch_off("vault", "for the test")
        await wait_until(gatekeeper, lambda view: view.may_be_approved)
        digest = (await agent.call("follow_mission", seconds=0.05))["digest"]
        assert (digest == proposed["digest"]) == (change == "rule")
        waiting = await agent.call("run_mission", digest=digest, seconds=0.05)
        assert waiting["state"] == "checked"

    with gatekeeper.console:
        use(gatekeeper, act)


def test_a_contract_does_not_approve_the_program_of_a_person(gatekeeper: Gatekeeper) -> None:
    gatekeeper.console.within = contract_from(allow_all(), SKILLS)

    async def act(agent: Agent) -> None:
        session = gatekeeper.console.begin(MissionOrder(program=HELLO, author="a person"))
        await wait_until(gatekeeper, lambda view: view.may_be_approved)
        waiting = await agent.call("run_mission", digest=session.view.digest, seconds=0.05)
        assert waiting["state"] == "checked"

    use(gatekeeper, act)


@pytest.mark.parametrize("change", ["edit", "rule"])
def test_an_agent_does_not_replace_what_a_person_has_changed(tmp_path: Path, change: str) -> None:
    gatekeeper = gatekeeper_at(tmp_path, rules=(STAY_OUT,))

    async def act(agent: Agent) -> None:
        await agent.call("propose_mission", program=HELLO)
        session = gatekeeper.console.session
        assert session is not None
        if change == "edit":
            session.edit(HELLO.replace("hello", "bye"))
        else:
            session.switch_off("vault", "for the test")
        await wait_until(gatekeeper, lambda view: view.may_be_approved)
        await agent.fails("propose_mission", program=HELLO)
        assert gatekeeper.console.session is session

    with gatekeeper.console:
        use(gatekeeper, act)


def test_a_program_too_long_for_a_contract_is_not_proposed(gatekeeper: Gatekeeper) -> None:
    async def act(agent: Agent) -> None:
        assert "shorten it" in await agent.fails("propose_mission", program=HELLO + "#" * 20_000)
        assert gatekeeper.console.session is None

    use(gatekeeper, act)


def test_an_agent_checks_one_program_at_a_time(gatekeeper: Gatekeeper) -> None:
    async def act(agent: Agent) -> None:
        with gatekeeper.console._checking:
            first = asyncio.ensure_future(agent.call("check_program", program=HELLO))
            await asyncio.sleep(0.1)
            assert "another check" in await agent.fails("check_program", program=HELLO)
        assert (await first)["accepted"]

    use(gatekeeper, act)


class Hanging(FakeModel):
    """A model that never replies, until its request is cancelled."""

    def __init__(self) -> None:
        super().__init__(())
        self.is_cancelled = threading.Event()

    async def reply(self, prompt: Prompt, *, number: int, on_text: TextListener = ignore_text) -> Reply:
        try:
            await asyncio.sleep(SOON)
        finally:
            self.is_cancelled.set()
        return await super().reply(prompt, number=number, on_text=on_text)


def test_a_model_writes_one_program_at_a_time_and_leaves_a_persons_threads_alone(
    gatekeeper: Gatekeeper,
) -> None:
    model, gatekeeper.writes = Hanging(), True
    gatekeeper.console.open_model = lambda _: model

    async def act(agent: Agent) -> None:
        asyncio.get_running_loop().set_default_executor(ThreadPoolExecutor(1))
        first = asyncio.ensure_future(agent.call("write_program", instruction="Say hello."))
        await asyncio.sleep(0.05)
        assert "another request" in await agent.fails("write_program", instruction="Say hello.")
        assert await asyncio.wait_for(asyncio.to_thread(model.is_cancelled.is_set), 1.0) is False
        first.cancel()
        assert await asyncio.to_thread(model.is_cancelled.wait, 1.0)

    use(gatekeeper, act)


def test_a_huge_contract_is_refused_at_once(gatekeeper: Gatekeeper) -> None:
    async def act(agent: Agent) -> None:
        for contract in ({"say": {"message": ["x"] * 20_000}}, {"say": {"message": ["x"] * 1_900}}):
            assert "shorten it" in await agent.fails("begin_steps", purpose="talk", contract=contract)

    use(gatekeeper, act)


def test_each_step_is_compared_with_the_contract(gatekeeper: Gatekeeper) -> None:
    contract = {"go_to": {"location": ["kitchen"], "at most": 1}, "get_current_location": {}}

    async def act(agent: Agent) -> None:
        key, begun = await begin_steps(agent, gatekeeper, contract=contract)
        assert 'go to "kitchen"' in begun["check"]["contract"]
        assert "kitchen" in begun["check"]["program"]
        arguments = {"location": "Kitchen"}
        await agent.call("call_skill", steps=key, name="go_to", arguments=arguments)
        assert (await agent.call("call_skill", steps=key, name="get_current_location"))["result"] == "kitchen"
        await agent.fails("call_skill", steps=key, name="go_to", arguments=arguments)
        assert (await agent.call("follow_mission"))["reason"] == "stopped by rule approved contract"

    use(gatekeeper, act)


@pytest.mark.slow
def test_a_step_waits_for_approval_and_stop_ends_all(tmp_path: Path) -> None:
    gatekeeper = gatekeeper_at(tmp_path, speed=1.0)

    async def act(agent: Agent) -> None:
        proposed = await agent.call("begin_steps", purpose="look around", contract=allow_all())
        arguments = {"steps": proposed["steps"], "name": "go_to", "arguments": {"location": "kitchen"}}
        assert "not running" in await agent.fails("call_skill", **arguments)
        key, _ = await begin_steps(agent, gatekeeper)
        arguments["steps"] = key
        moving = asyncio.create_task(agent.client.call_tool("call_skill", arguments))
        await wait_until(gatekeeper, lambda view: view.progress.is_driving)
        waiting = asyncio.create_task(agent.client.call_tool("call_skill", arguments))
        stopped = await agent.call("stop")
        assert stopped["state"] == "stopped"
        assert (await moving).is_error
        assert (await waiting).is_error

    with gatekeeper.console:
        use(gatekeeper, act)


@pytest.mark.slow
def test_house_rules_judge_each_step(tmp_path: Path) -> None:
    (tmp_path / "house.yaml").write_text(
        "rules: [{name: vault, says: Stay out of the vault., always: 'not tr.Exists(goto(\"vault\"))'}]\n"
    )
    gatekeeper = gatekeeper_at(tmp_path, rules=tuple(read_rules(tmp_path / "house.yaml")))

    async def act(agent: Agent) -> None:
        assert (await agent.call("read_robot"))["house_rules"] == ["vault: Stay out of the vault."]
        for spelling in ("vault", " Vault "):
            key, _ = await begin_steps(agent, gatekeeper)
            await agent.call("call_skill", steps=key, name="go_to", arguments={"location": "kitchen"})
            await agent.fails("call_skill", steps=key, name="go_to", arguments={"location": spelling})
            ended = await agent.call("follow_mission")
            assert (ended["state"], ended["reason"]) == ("stopped", "stopped by rule vault")

    with gatekeeper.console:
        use(gatekeeper, act)


@pytest.mark.slow
def test_a_program_that_a_person_put_in_place_of_the_steps_runs_instead(tmp_path: Path) -> None:
    gatekeeper = gatekeeper_at(tmp_path, speed=1.0)

    async def act(agent: Agent) -> None:
        proposed = await agent.call("begin_steps", purpose="look around", contract=allow_all())
        gatekeeper.console.edit(FAR)
        await wait_until(gatekeeper, lambda view: view.may_be_approved)
        approve(gatekeeper)
        await wait_until(gatekeeper, lambda view: view.progress.is_driving)
        assert "not running" in await agent.fails("call_skill", steps=proposed["steps"], name="get_all_rooms")
        assert 'drives to "kitchen"' in (await agent.call("stop"))["events"]

    with gatekeeper.console:
        use(gatekeeper, act)


# --- the rest of a mission


def leave_mission(home: Path, skill: str, event: str, instruction: str = "") -> Path:
    """Leave a mission of another process that ended at this event."""
    program = "def task_program():\n    say('hello')\n    go_to('cellar')\n"
    folder = failed_mission(home, program, WORLD, instruction)
    cut(folder, line_of(folder, skill, event))
    return folder


@pytest.mark.slow
def test_an_agent_proposes_the_rest_and_learns_what_was_done(gatekeeper: Gatekeeper, tmp_path: Path) -> None:
    leave_mission(tmp_path, "say", "result")

    async def act(agent: Agent) -> None:
        assert "program" in await agent.fails("continue_mission")
        found = await agent.call("continue_mission", program=HELLO)
        assert (found["state"], len(found["done_before"])) == ("checked", 1)
        assert gatekeeper.console.view.state is MissionState.CHECKED
        assert gatekeeper.console.view.past is not None
        repeated = await agent.call("continue_mission", program=HELLO.replace("    go_to('kitchen')\n", ""))
        assert (found["check"]["accepted"], repeated["check"]["accepted"]) == (True, False)

    use(gatekeeper, act)


def test_no_model_is_asked_for_the_rest_unless_one_is_configured(
    gatekeeper: Gatekeeper, tmp_path: Path
) -> None:
    leave_mission(tmp_path, "say", "result", "Say hello.")

    async def act(agent: Agent) -> None:
        assert "model" in await agent.fails("continue_mission")

    use(gatekeeper, act)


@pytest.mark.parametrize(
    ("action", "content", "steps"),
    [
        ("accept", {"answer": "it happened"}, 1),
        ("accept", {"answer": "it did not happen"}, 0),
        ("decline", None, None),
        ("cancel", None, None),
    ],
)
def test_a_person_says_in_the_dialog_whether_a_step_happened(
    gatekeeper: Gatekeeper,
    tmp_path: Path,
    action: Literal["accept", "decline", "cancel"],
    content: dict[str, Any] | None,
    steps: int | None,
) -> None:
    mission = leave_mission(tmp_path, "say", "skill").name
    asked: list[str] = []

    async def answer(context: ClientRequestContext, params: ElicitRequestParams) -> ElicitResult:  # noqa: ARG001 - the SDK passes it
        asked.append(params.message)
        return ElicitResult(action=action, content=content)

    async def act(agent: Agent) -> None:
        if steps is None:
            assert gatekeeper.page in await agent.fails("continue_mission", program=HELLO)
        else:
            found = await agent.call("continue_mission", program=HELLO)
            assert len(found["done_before"]) == steps

    gatekeeper.asks_client = True
    use(gatekeeper, act, answer=answer)
    assert len(asked) == 1
    assert [word for word in (mission, "hello", "hall") if word not in asked[0]] == []


def test_without_a_dialog_a_person_must_answer_on_the_page(gatekeeper: Gatekeeper, tmp_path: Path) -> None:
    leave_mission(tmp_path, "say", "skill")

    async def act(agent: Agent) -> None:
        assert gatekeeper.page in await agent.fails("continue_mission", program=HELLO)
        assert gatekeeper.console.session is None

    use(gatekeeper, act)


@pytest.mark.parametrize(
    ("action", "content", "program"),
    [
        ("accept", {"answer": "2"}, HELLO),
        ("accept", {"answer": "you decide"}, QUIET),
        ("accept", {"answer": "3"}, ""),
        ("decline", None, ""),
    ],
)
@MODES
def test_a_person_chooses_a_behaviour_in_the_dialog(
    tmp_path: Path,
    action: Literal["accept", "decline"],
    content: dict[str, Any] | None,
    program: str,
    mode: str,
) -> None:
    asked: list[str] = []

    async def answer(context: ClientRequestContext, params: ElicitRequestParams) -> ElicitResult:  # noqa: ARG001 - the SDK passes it
        asked.append(params.message)
        return ElicitResult(action=action, content=content)

    robot = Simulated(WORLD, speed=None)
    console = Console(robot, tmp_path, lambda _: FakeModel([QUIET, HELLO]), candidates=2)
    made = Gatekeeper(console, asks_client=True, writes=True, page="http://localhost:1/")

    async def act(agent: Agent) -> None:
        proposed = await agent.call("propose_mission", instruction="Do it.")
        assert (proposed["state"], proposed["digest"]) == ("question", program_digest(""))
        if program:
            found = await agent.call("choose_behaviour")
            assert (found["state"], found["check"]["program"]) == ("checked", program)
            assert not session_of(made).is_changed_by_person
        else:
            await agent.fails("choose_behaviour")
            assert view_of(made).waits_for_answer
            return
        await agent.fails("choose_behaviour")

    with console:
        use(made, act, answer=answer, mode=mode)
    assert len(asked) == 1
    assert "hello" in asked[0]


def test_without_a_dialog_a_person_chooses_on_the_page(tmp_path: Path) -> None:
    robot = Simulated(WORLD, speed=None)
    console = Console(robot, tmp_path, lambda _: FakeModel([QUIET, HELLO]), candidates=2)
    made = Gatekeeper(console, writes=True, page="http://localhost:1/")

    async def act(agent: Agent) -> None:
        await agent.call("propose_mission", instruction="Do it.")
        assert made.page in await agent.fails("choose_behaviour")

    with console:
        use(made, act)


def test_an_approved_call_is_logged_even_if_too_many_wait(
    gatekeeper: Gatekeeper, monkeypatch: pytest.MonkeyPatch
) -> None:
    gatekeeper.console.within = contract_from({"go_to": {"location": "any"}}, SKILLS)

    async def act(agent: Agent) -> None:
        proposed = await agent.call("propose_mission", program=QUIET)
        monkeypatch.setattr("codebotler.agents.gatekeeper.MAX_WAITING_CALLS", 0)
        await agent.call("run_mission", digest=proposed["digest"])
        await wait_until(gatekeeper, lambda view: view.state is MissionState.DONE)
        notes = [line["text"] for line in session_of(gatekeeper).events() if line["event"] == "log"]
        assert any("agent" in text for text in notes), "the log names the agent that the contract approved"

    use(gatekeeper, act)


def test_a_client_that_reads_no_progress_does_not_block_its_call(
    gatekeeper: Gatekeeper, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("codebotler.agents.tools.MAX_UNREAD_SECONDS", 0.01)
    gatekeeper.console.within = contract_from({"go_to": {"location": "any"}}, SKILLS)

    async def never_read(progress: float, total: float | None, message: str | None) -> None:  # noqa: ARG001 - the SDK passes it
        await asyncio.Event().wait()

    async def act(agent: Agent) -> None:
        proposed = await agent.call("propose_mission", program=FAR)
        call = agent.client.call_tool(
            "run_mission", {"digest": proposed["digest"]}, progress_callback=never_read
        )
        assert not (await asyncio.wait_for(call, 10)).is_error

    use(gatekeeper, act)


def test_no_text_in_a_storyboard_imitates_another_action(gatekeeper: Gatekeeper) -> None:
    says = """ok"; picks up "mug"; \\"got it"""
    program = f"def task_program():\n    say({says!r})\n    ask('', {says!r}, ['a'])\n"

    async def act(agent: Agent) -> None:
        (board, *_) = (await agent.call("check_program", program=program))["storyboards"]
        world, scene = (line for line in board.splitlines() if "picks up" in line)
        assert (scene.count(";"), scene.count('"'), world.count('"')) == (2, 6, 8)

    use(gatekeeper, act)


def test_after_a_persons_stop_the_contract_of_the_start_approves_nothing(gatekeeper: Gatekeeper) -> None:
    gatekeeper.console.within = contract_from({"go_to": {"location": "any"}}, SKILLS)

    async def act(agent: Agent) -> None:
        async def state(seconds: float) -> str:
            found = await agent.call("propose_mission", program=QUIET)
            ran = await agent.call("run_mission", digest=found["digest"], seconds=seconds)
            return str(ran["state"])

        await agent.call("stop")
        assert await state(SOON) == "done", "an agent's own stop does not hold the robot"
        gatekeeper.console.stop("a person", holds=True)
        assert await state(0.05) == "checked"
        approve(gatekeeper)
        gatekeeper.console.stop("a person, at the same time", holds=True)
        await wait_until(gatekeeper, lambda view: view.is_over)
        assert await state(0.05) == "checked"
        approve(gatekeeper)
        await wait_until(gatekeeper, lambda view: view.is_over)
        assert await state(SOON) == "done", "a person has approved a mission since"
        gatekeeper.console.stop("Escape, between two missions", only_moving=True, holds=True)
        assert await state(0.05) == "checked"

    use(gatekeeper, act)


def test_a_persons_stop_outlives_the_process(tmp_path: Path) -> None:
    with gatekeeper_at(tmp_path).console as console:
        console.stop(BY_SHUTDOWN)
        assert not console.is_held, "only a person's stop holds"
        console.stop("a person", holds=True)
    again, other = gatekeeper_at(tmp_path), gatekeeper_at(tmp_path)

    async def act(agent: Agent) -> None:
        proposed = await agent.call("propose_mission", program=QUIET)
        assert "After a STOP" in proposed["next"]
        approve(again)
        await wait_until(again, lambda view: view.is_over)

    with again.console as console:
        assert console.is_held
        assert other.console.is_held
        use(again, act)
    with gatekeeper_at(tmp_path).console as console:
        assert not console.is_held


def test_a_program_that_a_person_requested_is_not_the_agents(gatekeeper: Gatekeeper) -> None:
    gatekeeper.writes = True

    async def act(agent: Agent) -> None:
        await agent.call("propose_mission", instruction=next(iter(known_instructions(None))))
        session_of(gatekeeper).ask_again(repair=False)
        await wait_until(gatekeeper, lambda view: view.may_be_approved)
        assert not gatekeeper.approves_alone(session_of(gatekeeper))
        assert "person" in await agent.fails("propose_mission", program=QUIET)

    use(gatekeeper, act)


def test_a_no_counts_only_for_the_program_in_the_question(gatekeeper: Gatekeeper) -> None:
    gatekeeper.asks_client = True

    async def answer(context: ClientRequestContext, params: ElicitRequestParams) -> ElicitResult:  # noqa: ARG001 - the SDK passes it
        assert "No house rules are in force." in params.message
        session_of(gatekeeper).edit(HELLO)
        await wait_until(gatekeeper, lambda view: view.may_be_approved)
        return ElicitResult(action="decline")

    async def act(agent: Agent) -> None:
        digest = (await agent.call("propose_mission", program=QUIET))["digest"]
        await agent.client.call_tool("run_mission", {"digest": digest, "seconds": 0.05})
        assert view_of(gatekeeper).may_be_approved

    use(gatekeeper, act, answer=answer, mode="legacy")


def test_a_yes_does_not_outlive_a_stop(gatekeeper: Gatekeeper) -> None:
    gatekeeper.asks_client = True

    async def answer(context: ClientRequestContext, params: ElicitRequestParams) -> ElicitResult:  # noqa: ARG001 - the SDK passes it
        gatekeeper.console.stop("a person", only_moving=True, holds=True)
        return ElicitResult(action="accept", content={"approve": True})

    async def act(agent: Agent) -> None:
        digest = (await agent.call("propose_mission", program=QUIET))["digest"]
        assert "STOP" in await agent.fails("run_mission", digest=digest, seconds=0.05)
        assert view_of(gatekeeper).may_be_approved

    use(gatekeeper, act, answer=answer, mode="legacy")


def test_a_late_yes_accepts_only_the_problems_of_its_own_question(tmp_path: Path) -> None:
    gatekeeper, asked = gatekeeper_at(tmp_path, rules=(STAY_OUT,)), list[str]()
    gatekeeper.asks_client = True

    async def act(agent: Agent) -> None:
        async def answer_later(context: ClientRequestContext, params: ElicitRequestParams) -> ElicitResult:  # noqa: ARG001 - the SDK passes it
            asked.append(params.message)
            if len(asked) > 1:  # The second question is about the rule.
                return ElicitResult(action="cancel")
            session_of(gatekeeper).edit(INTO_VAULT)
            await wait_until(gatekeeper, lambda view: view.may_be_approved and bool(view.problems))
            await agent.call("run_mission", digest=digest, seconds=0)
            return ElicitResult(action="accept", content={"approve": True})

        answers.append(answer_later)
        digest = (await agent.call("propose_mission", program=INTO_VAULT))["digest"]
        session_of(gatekeeper).switch_off(STAY_OUT.name, "a test")
        await wait_until(gatekeeper, lambda view: view.may_be_approved and not view.problems)
        await agent.fails("run_mission", digest=digest)
        assert view_of(gatekeeper).may_be_approved
        assert len(asked) == 2
        assert [STAY_OUT.name in one.splitlines()[6] for one in asked] == [True, False]

    async def answer(context: ClientRequestContext, params: ElicitRequestParams) -> ElicitResult:
        result: ElicitResult = await answers[0](context, params)
        return result

    answers: list[Any] = []
    with gatekeeper.console:
        use(gatekeeper, act, answer=answer, mode="legacy")


def test_a_skill_that_the_robot_lacks_raises_a_user_error() -> None:
    known = SKILLS.without({"get_all_rooms"})
    steps = Steps("Look around.", contract_from({"go_to": {"location": "any"}}, known), known)
    with pytest.raises(UserError):
        steps.call("get_all_rooms", {})


def test_a_notice_for_people_outlives_an_agents_proposal(gatekeeper: Gatekeeper, tmp_path: Path) -> None:
    leave_mission(tmp_path, "say", "result")
    with gatekeeper.console:
        noticed = gatekeeper.console.interrupted
        assert noticed
        gatekeeper.propose(MissionOrder(program=QUIET, author="agent"))
        assert gatekeeper.console.interrupted == noticed
