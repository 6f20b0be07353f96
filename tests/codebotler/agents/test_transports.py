"""Agents connect over standard input and output, and over HTTP, in real processes."""

from __future__ import annotations

import asyncio
import http.client
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, closing
from pathlib import Path
from typing import Any
from urllib.parse import unquote_plus

import httpx2
import pytest
from mcp import Client, StdioServerParameters
from mcp.client.session import ClientRequestContext
from mcp.client.streamable_http import streamable_http_client
from mcp_types import ElicitRequestParams, ElicitResult

from codebotler.cli.operating.mcp import serve_agents
from codebotler.core.errors import UserError
from codebotler.missions.storage.store import read_missions
from codebotler.web.security.access import Access, Role
from forked import PAGE, PROGRAMS, Forked
from pageserver import WORLD, PageServer

HELLO = "def task_program():\n    go_to('kitchen')\n    say('hello')\n"
FAR = "def task_program():\n    for _ in range(50):\n        go_to('kitchen')\n        go_to('hall')\n"
SERVE = ("codebotler", "mcp", "--http", "--world", "world.yaml")
SERVER = (*PAGE, *PROGRAMS, "codebotler.agents.server")
SOON = 60.0
DRIVES = {"go_to": {"location": "any"}, "get_all_rooms": {}, "get_current_location": {}}


async def call(client: Client, tool: str, **arguments: Any) -> Any:  # noqa: ANN401 - any tool's result
    result = await client.call_tool(tool, arguments)
    assert not result.is_error, result.content
    return result.structured_content


# --- over HTTP, next to the page


class AgentServer(PageServer):
    """A process of `codebotler mcp --http`."""

    @property
    def agent_token(self) -> str:
        ends = time.monotonic() + SOON
        while (found := re.search(r"Authorization: Bearer (\S+)\n", self.output)) is None:
            assert time.monotonic() < ends, self.output
            time.sleep(0.02)
        return found[1]

    @asynccontextmanager
    async def client(self, mode: str = "auto") -> AsyncIterator[Client]:
        headers = {"authorization": f"Bearer {self.agent_token}"}
        async with (
            httpx2.AsyncClient(headers=headers, timeout=SOON) as http_client,
            Client(
                streamable_http_client(f"http://127.0.0.1:{self.port}/mcp", http_client=http_client),
                mode=mode,
            ) as client,
        ):
            yield client

    def approve(self) -> None:
        """Approve the current program, as the page does."""
        digest = self.call("GET", "/api/missions/current").data["digest"]
        answer = self.call("POST", "/api/missions/current/approve", {"program": digest})
        assert answer.status == 200, answer.text

    def wait_for(self, state: str) -> None:
        ends = time.monotonic() + SOON
        while (now := self.call("GET", "/api/robot").data["state"]) != state:
            assert time.monotonic() < ends, now
            time.sleep(0.02)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[AgentServer]:
    with AgentServer(tmp_path_factory.mktemp("http"), "--speed", "3", serve=SERVE) as made:
        yield made


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["auto", "legacy"])
def test_all_tools_work_over_http(server: AgentServer, mode: str) -> None:
    async def main() -> None:
        async with asyncio.timeout(SOON), server.client(mode=mode) as client:
            robot = await call(client, "read_robot")
            assert robot["rooms"] == ["hall", "kitchen", "study"]
            assert (await call(client, "check_program", program=HELLO))["accepted"]
            proposed = await call(client, "propose_mission", instruction="hello", program=HELLO)
            assert f"http://127.0.0.1:{server.port}/" in proposed["next"]
            assert server.token not in json.dumps(proposed)
            said: list[str | None] = []

            async def hear(progress: float, total: float | None, message: str | None) -> None:  # noqa: ARG001 - the SDK passes it
                said.append(message)

            arguments = {"digest": proposed["digest"]}
            running = asyncio.create_task(client.call_tool("run_mission", arguments, progress_callback=hear))
            await asyncio.sleep(0.2)
            await asyncio.to_thread(server.approve)
            done = (await running).structured_content
            assert done is not None
            assert (done["state"], done["mission"]) == ("done", proposed["mission"])
            assert 'drives to "kitchen"' in said
            stepwise = await call(client, "begin_steps", purpose="look", contract=DRIVES)
            starting = asyncio.create_task(call(client, "run_mission", digest=stepwise["digest"]))
            await asyncio.to_thread(server.approve)
            assert (await starting)["state"] == "running"
            moved = await call(
                client, "call_skill", steps=stepwise["steps"], name="go_to", arguments={"location": "study"}
            )
            assert moved["error"] == ""
            assert (await call(client, "end_steps", steps=stepwise["steps"]))["state"] == "done"
            assert (await call(client, "follow_mission", seconds=0))["is_over"]
            assert (await call(client, "stop"))["is_over"]
            log = await client.read_resource(f"codebotler://missions/{proposed['mission']}/log")
            assert "hello" in getattr(log.contents[0], "text", "")

    asyncio.run(main())


@pytest.mark.slow
def test_a_second_client_stops_the_mission_of_the_first(server: AgentServer) -> None:
    async def main() -> None:
        async with asyncio.timeout(SOON), server.client() as first, server.client() as second:
            proposed = await call(first, "propose_mission", program=FAR)
            running = asyncio.create_task(call(first, "run_mission", digest=proposed["digest"]))
            await asyncio.to_thread(server.approve)
            await asyncio.to_thread(server.wait_for, "running")
            assert (await call(second, "stop"))["state"] == "stopped"
            assert (await running)["state"] == "stopped"

    asyncio.run(main())


def test_an_agents_token_opens_nothing_but_its_own_path(server: AgentServer) -> None:
    with_token = {"authorization": f"Bearer {server.agent_token}"}
    assert server.agent_token not in {server.token, unquote_plus(server.token)}
    for method, path in (
        *(("GET", path) for path in ("/", "/api/robot", "/missions", "/api/missions", "/mcp/", "/mcp/x")),
        *(("POST", path) for path in ("/api/missions", "/api/missions/current/approve", "/api/stop")),
    ):
        assert server.ask(method, path, {} if method == "POST" else None, **with_token).status == 403, path
    opened = server.ask("GET", f"/?token={server.agent_token}")
    assert (opened.status, opened.headers.get("set-cookie")) == (401, None)
    assert server.ask("GET", "/api/robot", cookie=server.cookie).status == 200


@pytest.mark.parametrize("token", ["", "Bearer wrong", "Bearer", "Basic wrong"])
def test_a_wrong_token_is_refused(server: AgentServer, token: str) -> None:
    headers = {"authorization": token} if token else {}
    accept = "application/json, text/event-stream"
    assert server.ask("POST", "/mcp", INITIALIZE, accept=accept, **headers).status == 401


def test_pages_of_other_sites_and_other_hosts_are_refused(server: AgentServer) -> None:
    headers = {
        "authorization": f"Bearer {server.agent_token}",
        "accept": "application/json, text/event-stream",
    }
    assert server.ask("POST", "/mcp", INITIALIZE, **headers, origin="http://evil.example").status == 403
    assert server.ask("POST", "/mcp", INITIALIZE, **headers, host="evil.example").status == 421
    assert server.ask("POST", "/mcp", INITIALIZE, **headers).status == 200


def test_no_stream_stays_open_without_a_call(server: AgentServer) -> None:
    headers = {
        "authorization": f"Bearer {server.agent_token}",
        "accept": "application/json, text/event-stream",
    }
    session = server.ask("POST", "/mcp", INITIALIZE, **headers).headers["mcp-session-id"]
    meta = {"protocolVersion": "2026-07-28", "clientInfo": CLIENT, "clientCapabilities": {}}
    params = {
        "_meta": {f"io.modelcontextprotocol/{key}": value for key, value in meta.items()},
        "notifications": {"toolsListChanged": True},
    }
    listen = {"jsonrpc": "2.0", "id": 2, "method": "subscriptions/listen", "params": params}
    new = {"mcp-protocol-version": "2026-07-28", "mcp-method": "subscriptions/listen"}
    new["content-type"] = "application/json"
    found: list[int] = []
    for method, text, more in (
        ("GET", None, {"mcp-session-id": session}),
        ("POST", json.dumps(listen), new),
    ):
        with closing(http.client.HTTPConnection("127.0.0.1", server.port, timeout=SOON)) as connection:
            connection.request(method, "/mcp", text, {**headers, **more})
            found.append(connection.getresponse().status)  # A stream would never end.
    assert found == [405, 404]


CLIENT = {"name": "plain", "version": "1"}
INITIALIZE = {
    "jsonrpc": "2.0",
    "id": 1,
    "method": "initialize",
    "params": {
        "protocolVersion": "2025-06-18",
        "capabilities": {},
        "clientInfo": CLIENT,
    },
}
"""The first request of clients that use last year's protocol."""


class PlainClient:
    """A client without the SDK, which speaks last year's protocol over HTTP."""

    def __init__(self, server: AgentServer) -> None:
        self._server, self._number, self._session = server, 1, ""
        self.name = self.send(INITIALIZE)["serverInfo"]["name"]
        self.send({"jsonrpc": "2.0", "method": "notifications/initialized"})

    def send(self, message: dict[str, Any]) -> Any:  # noqa: ANN401 - any result
        connection = http.client.HTTPConnection("127.0.0.1", self._server.port, timeout=SOON)
        headers = {
            "authorization": f"Bearer {self._server.agent_token}",
            "content-type": "application/json",
            "accept": "application/json, text/event-stream",
            **({"mcp-session-id": self._session} if self._session else {}),
        }
        connection.request("POST", "/mcp", json.dumps(message), headers)
        answer = connection.getresponse()
        text = answer.read().decode()
        self._session = answer.headers.get("mcp-session-id", self._session)
        connection.close()
        if "id" not in message:
            assert answer.status == 202, text
            return None
        answers = [json.loads(line[6:]) for line in text.splitlines() if line.startswith("data: {")]
        return next(one["result"] for one in answers if one.get("id") == message["id"])

    def call(self, tool: str, **arguments: Any) -> Any:  # noqa: ANN401 - any tool's result
        self._number += 1
        params = {"name": tool, "arguments": arguments}
        result = self.send({"jsonrpc": "2.0", "id": self._number, "method": "tools/call", "params": params})
        assert not result.get("isError"), result
        return result["structuredContent"]


@pytest.mark.slow
def test_a_client_without_the_sdk_drives_a_mission(server: AgentServer) -> None:
    client = PlainClient(server)
    assert client.name == "codebotler"
    assert client.call("read_robot")["robot"] == "simulated"
    proposed = client.call("propose_mission", program=HELLO)
    assert client.call("run_mission", digest=proposed["digest"], seconds=0.1)["state"] == "checked"
    server.approve()
    assert client.call("run_mission", digest=proposed["digest"], seconds=50)["state"] == "done"
    assert client.call("stop")["state"] == "done"


# --- over standard input and output


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "codebotler", "mcp", "--world", "world.yaml", "--port", "0", *arguments]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "world.yaml").write_text(WORLD)
    return tmp_path


def environment(folder: Path) -> dict[str, str]:
    return {**os.environ, "CODEBOTLER_HOME": str(folder / "home")}


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["auto", "legacy"])
def test_all_tools_work_over_stdio(folder: Path, mode: str) -> None:
    program, *arguments = command("--speed", "0")
    started = StdioServerParameters(command=program, args=arguments, env=environment(folder), cwd=folder)
    questions: list[str] = []

    async def accept(context: ClientRequestContext, params: ElicitRequestParams) -> ElicitResult:  # noqa: ARG001 - the SDK passes it
        questions.append(params.message)
        return ElicitResult(action="accept", content={"approve": True})

    async def main() -> None:
        async with (
            asyncio.timeout(SOON),
            Client(started, elicitation_callback=accept, mode=mode) as client,
        ):
            assert len((await client.list_tools()).tools) == 12
            assert (await call(client, "read_robot"))["rooms"] == ["hall", "kitchen", "study"]
            assert (await call(client, "check_program", program=HELLO))["accepted"]
            proposed = await call(client, "propose_mission", instruction="hello", program=HELLO)
            assert "http://127.0.0.1:" in proposed["next"]
            done = await call(client, "run_mission", digest=proposed["digest"])
            assert (done["state"], len(questions)) == ("done", 1)
            stepwise = await call(
                client,
                "begin_steps",
                purpose="look",
                contract=DRIVES,
            )
            await call(client, "run_mission", digest=stepwise["digest"])
            key = stepwise["steps"]
            assert (await call(client, "call_skill", steps=key, name="get_all_rooms"))["result"]
            assert (await call(client, "end_steps", steps=key))["state"] == "done"
            assert (await call(client, "stop"))["is_over"]
            assert (await call(client, "follow_mission"))["state"] == "done"

    asyncio.run(main())
    assert [summary.state for summary in read_missions(folder / "home")] == ["done", "done"]


def pack(*messages: dict[str, Any]) -> bytes:
    return b"".join(json.dumps(message).encode() + b"\n" for message in messages)


def request(number: int, name: str, **arguments: Any) -> dict[str, Any]:  # noqa: ANN401 - any arguments
    params = {"name": name, "arguments": arguments}
    return {"jsonrpc": "2.0", "id": number, "method": "tools/call", "params": params}


NOISY_SKILLS = """
import os
from codebotler import Simulation, skill
print("noise at the import")
os.system("echo noise of a child")

@skill
def wave(sim: Simulation) -> None:
    \"\"\"Wave.\"\"\"
    print("noise of a skill")
"""
HANDSHAKE = pack(INITIALIZE, {"jsonrpc": "2.0", "method": "notifications/initialized"})


CLOSING = """
import os
from codebotler.agents.server import take_streams
streams = take_streams()
numbers = [one.fileno() for one in streams]
for one in streams:
    one.close()
for number in numbers:
    os.close(number)  # still open
"""


@pytest.mark.slow
def test_only_the_event_loop_closes_the_descriptors_of_the_streams() -> None:
    # A descriptor that is closed twice may by then be a file of a mission, which another thread has opened.
    with Forked("-c", CLOSING, cwd=Path.cwd(), environment=os.environ, preload=SERVER) as running:
        running.communicate()
        assert running.returncode == 0


@pytest.mark.slow
def test_nothing_but_the_protocol_goes_to_standard_output(folder: Path) -> None:
    (folder / "skills.py").write_text(NOISY_SKILLS)
    _, _, *words = command("--skills", "skills.py", "--speed", "0")
    with Forked(*words, cwd=folder, environment=environment(folder), preload=SERVER) as running:
        assert running.stdout is not None
        program = "def task_program():\n    print('noise')\n    wave()\n"
        to = running.stdin.buffer
        to.write(HANDSHAKE + b"not json\n" + pack(request(2, "check_program", program=program)))
        to.write(pack(request(3, "propose_mission", program=program), request(4, "no_such_tool")))
        running.stdin.flush()
        answers: dict[object, Any] = {}
        while {1, 2, 3, 4} - {*answers}:
            message = json.loads(running.stdout.readline())
            assert message["jsonrpc"] == "2.0"
            answers[message.get("id")] = message
        assert answers[3]["result"]["structuredContent"]["state"] == "checked"
        rest, said = running.communicate(timeout=SOON)
        assert (rest, running.returncode) == ("", 0)
        assert "?token=" in said
    (summary,) = read_missions(folder / "home")
    assert summary.state == "stopped"


@pytest.mark.slow
@pytest.mark.parametrize(
    "ending", ["signal", "early signal", "closed terminal", "closed input", "closed input, nothing read"]
)
def test_a_running_robot_stops_with_the_server(folder: Path, ending: str) -> None:
    _, _, *words = command()
    with (
        Path(os.devnull).open("w") as nowhere,
        Forked(
            *words,
            cwd=folder,
            environment=environment(folder),
            stderr=nowhere,
            preload=SERVER,
        ) as running,
    ):
        assert running.stdout is not None
        asking = {**INITIALIZE, "params": {**INITIALIZE["params"], "capabilities": {"elicitation": {}}}}  # type: ignore[dict-item]  # a dictionary
        running.stdin.buffer.write(pack(asking, {"jsonrpc": "2.0", "method": "notifications/initialized"}))
        running.stdin.buffer.write(pack(request(2, "propose_mission", program=FAR)))
        running.stdin.buffer.flush()
        while (message := json.loads(running.stdout.readline())).get("id") != 2:
            pass
        digest = message["result"]["structuredContent"]["digest"]
        running.stdin.buffer.write(pack(request(3, "run_mission", digest=digest)))
        running.stdin.buffer.flush()
        while (message := json.loads(running.stdout.readline())).get("method") != "elicitation/create":
            pass
        result = {"action": "accept", "content": {"approve": True}}
        running.stdin.buffer.write(pack({"jsonrpc": "2.0", "id": message["id"], "result": result}))
        running.stdin.buffer.flush()
        wait_for_event(folder, "running" if ending == "early signal" else "skill")
        if ending.endswith(("signal", "terminal")):
            running.send_signal(signal.SIGHUP if ending == "closed terminal" else signal.SIGTERM)
            running.wait(SOON)
        elif ending == "closed input, nothing read":
            running.stdin.buffer.write(pack(*(request(number, "read_robot") for number in range(4, 300))))
        running.stdin.close()
        if ending != "closed input, nothing read":
            running.stdout.read()
        running.wait(SOON)
    (summary,) = read_missions(folder / "home")
    assert summary.state == "stopped"


def wait_for_event(folder: Path, event: str) -> None:
    """Wait until the log of a mission has an event or a state."""
    ends = time.monotonic() + SOON
    while f'": "{event}"' not in "".join(
        path.read_text() for path in folder.glob("home/missions/*/events.jsonl")
    ):
        assert time.monotonic() < ends
        time.sleep(0.02)


@pytest.mark.slow
def test_start_without_a_client_recommends_http(folder: Path) -> None:
    ended = subprocess.run(
        command(),
        cwd=folder,
        env=environment(folder),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
    )
    assert (ended.returncode, ended.stdout) == (2, b"")
    assert b"--http" in ended.stderr
    assert len(ended.stderr.splitlines()) == 1


def test_an_agents_token_is_refused_without_http() -> None:
    with pytest.raises(UserError, match="--http"):
        serve_agents(agent_token="0123456789abcdef")


def test_an_agents_token_is_long_and_differs_from_the_others() -> None:
    for wrong in ("short", "operator's own token", "the face's own token"):
        with pytest.raises(UserError, match="token"):
            Access.from_options("operator's own token", "the face's own token", wrong)
    made, other = (Access.from_options("operator's own token") for _ in range(2))
    assert made.of_token(made.agent, "") is Role.AGENT
    assert other.of_token(made.agent, "") is None
