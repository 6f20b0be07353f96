"""An action server for `is_in_room` on ROS 1 that looks at a camera's picture with a model that sees.

    python is_in_room_server.py --model openai-chat:gpt-5.1 --topic /camera/image_raw

It runs under CodeBotler's Python; what it does on the graph happens in a process of the robot's own Python.
"""

import argparse
import base64
import math
import queue
import sys
import threading
import time
from pathlib import Path
from typing import Any

from PIL.Image import Image

from codebotler import SamplingSettings, UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.perception import (
    Detector,
    PerceptionError,
    boxed,
    image_from_ros,
    jpeg_of,
    open_detector,
    read_image,
)
from codebotler.robots.base import NotReadyError
from codebotler.robots.ros.connection import connection_of
from codebotler.robots.ros.robot import calls_data
from codebotler.robots.ros.ros1 import master_uri
from codebotler.robots.ros.worker import RosWorker

SKILL = "is_in_room"
HEARS = 3600.0  # seconds of one turn of listening
AGAIN = 0.1  # seconds until a camera is asked again that has no picture


class Server:
    """Takes goals, one at a time, and answers them by what it sees.

    Args:
        detector: says what is in a picture.
        file: the picture; None for the camera's.
        topic: of the camera.
        oldest: how many seconds ago a camera's picture may have come; for so long one is waited for, too.
        python: that has rospy.
    """

    def __init__(
        self, detector: Detector, *, file: Path | None, topic: str, oldest: float, python: Path
    ) -> None:
        self.detector, self.file, self.topic, self.oldest = detector, file, topic, oldest
        address = master_uri()
        actions = calls_data(connection_of(SkillTable((SKILLS[SKILL],))))
        start = {"node": f"{SKILL}_server", "actions": actions, "port": None, "camera": topic, "show": True}
        self.worker = RosWorker(python, "servers.py", start, {"ROS_MASTER_URI": address})
        print(f"at {address}; ready, Ctrl-C ends it", flush=True)
        self.goals: queue.SimpleQueue[tuple[str, str]] = queue.SimpleQueue()
        self.images: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self.open: set[str] = set()
        self.lock = threading.Lock()

    def serve(self) -> None:
        """Listen until the worker dies."""
        threading.Thread(target=self.work, daemon=True).start()
        while True:
            message = self.worker.receive(HEARS) or {}
            match message:
                case {"is": "image"}:
                    self.images.put(message)
                case {"is": "goal", "id": str(goal), "arguments": [str(label)]}:
                    self.open.add(goal)
                    self.goals.put((goal, label))
                case {"is": "cancel", "id": str(goal)}:  # looking moves nothing, so that it has ended at once
                    self.end(goal, do="cancelled")
                case {"is": "ended"}:
                    sys.exit(f"the worker has died ({self.worker.how_it_ended()})")

    def work(self) -> None:
        """Look for what goals name."""
        while True:
            goal, label = self.goals.get()
            if goal not in self.open:
                continue
            try:
                image = self.picture()
                sighting = self.detector.look(image, label)
            except Exception as error:  # noqa: BLE001 - whatever it is, the robot waits for an answer
                expected = isinstance(error, UserError | PerceptionError)
                why = str(error) if expected else f"{type(error).__name__}: {error}"
                print(f"{label!r}: {why!r}", flush=True)
                self.end(goal, do="abort", text=why)
                continue
            print(f"{label!r}: {sighting}", flush=True)
            picture = base64.b64encode(jpeg_of(boxed(image, sighting))).decode()
            self.end(goal, do="succeed", value=sighting.found, picture=picture, skill=SKILL)

    def picture(self) -> Image:
        """What there is to see."""
        if self.file is not None:
            return read_image(self.file)
        until = time.monotonic() + self.oldest
        while True:
            self.worker.send({"do": "look", "oldest": self.oldest})
            image = self.images.get()
            if "none" not in image:
                return image_from_ros(image, f"the picture on {self.topic}")
            if time.monotonic() > until:
                raise PerceptionError(image["none"])
            time.sleep(AGAIN)

    def end(self, goal: str, **ending: Any) -> None:  # noqa: ANN401 - a line of JSON
        """Say how a goal ended, unless it has."""
        with self.lock:
            if goal in self.open:
                self.open.remove(goal)
                self.worker.send({**ending, "id": goal})


def main() -> None:
    """Serve until Ctrl-C."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--topic", default="", help="of a camera: sensor_msgs/Image or CompressedImage")
    source.add_argument("--file", type=Path, help="a picture, which is read anew for each goal")
    parser.add_argument("--model", required=True, help="a chat model that sees, or hf:PATH")
    parser.add_argument("--base-url", help="where a chat model is served")
    parser.add_argument("--least-score", type=float, default=0.1, help="of what hf:PATH finds")
    parser.add_argument("--oldest", type=float, default=5.0, help="seconds since a picture of a camera came")
    python = Path("/usr/bin/python3")
    parser.add_argument("--ros-python", type=Path, default=python, help="the Python that has rospy")
    said = parser.parse_args()
    if not 0 < said.oldest < math.inf:
        parser.error(f"--oldest is {said.oldest:g}, but must be a number of seconds above 0")
    try:
        settings = SamplingSettings(
            temperature=0.0, top_p=None, max_tokens=2000, timeout=30.0, base_url=said.base_url
        )
        detector = open_detector(said.model, settings, least_score=said.least_score)
        server = Server(
            detector, file=said.file, topic=said.topic, oldest=said.oldest, python=said.ros_python
        )
    except (UserError, NotReadyError) as error:
        parser.error(str(error))
    try:
        server.serve()
    except KeyboardInterrupt:
        server.worker.leave()


if __name__ == "__main__":
    main()
