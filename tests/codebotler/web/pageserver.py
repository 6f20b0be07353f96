"""Start the page as a user does, in a process of its own and on a free port."""

from __future__ import annotations

import http.client
import json
import os
import re
import signal
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self
from urllib.parse import unquote_plus

from forked import PAGE, Forked

WORLD = """about: a small house
robot: hall
rooms: [hall, kitchen, study]
objects: {kitchen: [mug]}
people: {study: [{name: ann, answers: ["yes"]}]}
"""

SERVE = ("codebotler", "serve", "--world", "world.yaml")


@dataclass(frozen=True)
class Answer:
    """An answer of a server.

    Args:
        status: the status of HTTP.
        headers: the headers, by lower-case name.
        text: the body.
    """

    status: int
    headers: dict[str, str]
    text: str

    @property
    def data(self) -> Any:  # noqa: ANN401 - JSON has no types
        return json.loads(self.text)


class PageServer:
    """`codebotler serve` in a folder. As a context manager, it ends the process.

    Args:
        folder: the folder of the world file and the missions.
        arguments: more arguments of the command.
        world: the text of the world file.
        serve: another command that serves a page.
    """

    def __init__(
        self, folder: Path, *arguments: str, world: str = WORLD, serve: Sequence[str] = SERVE
    ) -> None:
        self.home = folder / "home"
        (folder / "world.yaml").write_text(world)
        name, words = serve[0], (*serve[1:], "--port", "0", *arguments)
        variables = {**os.environ, "CODEBOTLER_HOME": str(self.home), "NO_PROXY": "*"}
        self._output = folder / "said.txt"
        with self._output.open("w") as file:
            self._process = Forked(name, *words, cwd=folder, environment=variables, stderr=file, preload=PAGE)
        while (link := re.search(r"http://\S+:(\d+)/(?:\?token=(\S+))?\n", self.output)) is None:
            assert self._process.poll() is None, self.output
            time.sleep(0.02)
        self.link, self.port, self.token = link[0].strip(), int(link[1]), link[2] or ""

    @property
    def face_token(self) -> str:
        """The token of the robot's face, if it has one."""
        ends = time.monotonic() + 60
        while (found := re.search(r"/face\?token=(\S+)\n", self.output)) is None:
            assert time.monotonic() < ends, self.output
            time.sleep(0.02)
        return found[1]

    @property
    def output(self) -> str:
        """The output of the process so far."""
        return self._output.read_text()

    @property
    def pid(self) -> int:
        """The ID of the process."""
        return self._process.pid

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end()

    def end(self, number: int = signal.SIGTERM) -> int:
        """End the process, and return its status."""
        self._process.send_signal(number)
        self._process.communicate(timeout=60)
        return self._process.wait()

    def ask(self, method: str, path: str, body: object = None, **headers: str) -> Answer:
        """Send a request unchanged; it has no token unless a header has one."""
        given = {name.replace("_", "-"): value for name, value in headers.items()}
        text = body if isinstance(body, bytes | str) else None if body is None else json.dumps(body)
        if text is not None:
            given.setdefault("content-type", "application/json")
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        try:
            connection.request(method, path, text, given)
            answer = connection.getresponse()
            found = {name.lower(): value for name, value in answer.getheaders()}
            return Answer(answer.status, found, answer.read().decode())
        finally:
            connection.close()

    def call(self, method: str, path: str, body: object = None) -> Answer:
        """Send a request as the API's clients do, with the token."""
        return self.ask(method, path, body, authorization=f"Bearer {unquote_plus(self.token)}")

    @property
    def face_link(self) -> str:
        """The link that opens the robot's face, if it has one."""
        return f"http://127.0.0.1:{self.port}/face?token={self.face_token}"

    def face(self, method: str, path: str, body: object = None) -> Answer:
        """Send a request with the token of the robot's face."""
        return self.ask(method, path, body, authorization=f"Bearer {unquote_plus(self.face_token)}")

    def run(self, program: str, *, despite_problems: bool = False) -> None:
        """Let the robot run a program, as the API's clients do."""
        begun = self.call("POST", "/api/missions", {"program": program})
        assert begun.status == 201, begun.text
        ends = time.monotonic() + 60
        while (view := self.call("GET", "/api/missions/current").data)["check"] is None:
            assert time.monotonic() < ends, view
            time.sleep(0.01)
        approval = {"program": view["digest"], "despite_problems": despite_problems}
        approved = self.call("POST", "/api/missions/current/approve", approval)
        assert approved.status == 200, approved.text

    def rest(self) -> None:
        """Stop the current mission, and one that a closing page may begin after it."""
        stopped, ends = None, time.monotonic() + 60
        while not (robot := self.call("GET", "/api/robot").data)["is_over"]:
            assert time.monotonic() < ends, "the robot does not come to rest"
            if robot["mission"] != stopped:
                stopped = robot["mission"]
                self.call("POST", "/api/stop")
            time.sleep(0.02)

    @property
    def cookie(self) -> str:
        """The cookie that a browser sends once it has opened the link."""
        answer = self.ask("GET", f"/?token={self.token}")
        return answer.headers["set-cookie"].partition(";")[0]

    @property
    def path(self) -> str:
        """The path to which its cookie belongs."""
        return self.ask("GET", f"/?token={self.token}").headers["location"].rstrip("/")

    @property
    def inside(self) -> str:
        """The address below which a browser stays once it has opened the link."""
        return f"http://127.0.0.1:{self.port}{self.path}"
