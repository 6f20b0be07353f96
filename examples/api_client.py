"""Run a program on a robot over the API: start a mission, read its check, approve it, answer questions.

Pass the operator's link that `codebotler serve --face` printed; without one, the script starts its own page
with a simulated robot.
"""

import http.client
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

PROGRAM = """def task_program():
    go_to('kitchen')
    if ask('anybody', 'Is the tea ready?', ['Yes', 'No']) == 'Yes':
        say('Tea is ready')
"""
WORLD = "robot: hall\nrooms: [hall, kitchen]\n"


class Robot:
    """A robot behind a page.

    Args:
        link: the link that `codebotler serve` prints, with the token.
    """

    def __init__(self, link: str) -> None:
        parts = urlsplit(link)
        self._place, token = parts.netloc, parse_qs(parts.query).get("token", [""])[0]
        self._headers = {"Authorization": f"Bearer {token}", "Content-Type": "application/json"}

    def ask(self, method: str, path: str, body: object = None) -> http.client.HTTPResponse:
        """Send a request, and return its response, which may be a stream."""
        connection = http.client.HTTPConnection(self._place, timeout=60)
        connection.request(method, path, None if body is None else json.dumps(body), self._headers)
        answer = connection.getresponse()
        if answer.status >= http.HTTPStatus.BAD_REQUEST:
            raise SystemExit(answer.read().decode())
        return answer

    def run(self, program: str) -> None:
        """Run a program on the robot, and print its events."""
        mission = json.load(self.ask("POST", "/api/missions", {"program": program}))["id"]
        while (view := json.load(self.ask("GET", f"/api/missions/{mission}")))["check"] is None:
            time.sleep(0.1)
        print(f"problems: {view['problems']}")
        self.ask("POST", f"/api/missions/{mission}/approve", {"program": view["digest"]})
        for line in self.ask("GET", f"/api/missions/{mission}/events"):  # until the mission has ended
            if line.startswith(b"data: "):
                event = json.loads(line.removeprefix(b"data: "))
                print(event["event"], event.get("state") or event.get("arguments") or "")
                if (event["event"], event.get("skill")) == ("skill", "ask"):
                    self.answer()

    def answer(self) -> None:
        """Choose the first option of the robot's question, as a person at its face could."""
        while (question := json.load(self.ask("GET", "/api/face"))["question"]) is None:
            time.sleep(0.1)
        self.ask("POST", "/api/face/answer", {"question": question["number"], "option": 0})


def main() -> None:
    """Run the program."""
    if len(sys.argv) > 1:
        Robot(sys.argv[1]).run(PROGRAM)
        return
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "world.yaml").write_text(WORLD)
        command = [sys.executable, "-m", "codebotler", "serve"]
        command += ["--port", "0", "--speed", "0", "--world", "world.yaml", "--face"]
        home = {**os.environ, "CODEBOTLER_HOME": folder}
        with subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True, env=home) as page:
            assert page.stderr is not None
            link = next(line.strip() for line in page.stderr if "token=" in line)
            try:
                Robot(link).run(PROGRAM)
            finally:
                page.terminate()


if __name__ == "__main__":
    main()
