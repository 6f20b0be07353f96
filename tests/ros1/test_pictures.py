"""Pictures on a real graph: from a camera through a model that sees, and into the log of a mission."""

from __future__ import annotations

import base64
import io
import json
import os
import re
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from xmlrpc.client import ServerProxy

import pytest
from mcap.reader import make_reader

from bridges import bridge, ros_handler
from codebotler.core.errors import RobotError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.missions.storage.log import read_events
from codebotler.robots.base import CameraPicture, CancelledError, Options
from codebotler.robots.ros import kinds
from codebotler.robots.ros.caller import Timeouts
from codebotler.robots.ros.connections.connection_file import read_connection
from codebotler.robots.ros.robot import RosRobot
from codebotler.robots.ros.worker import WORKERS_FOLDER
from forked import Forked
from halves import encoded, has_frame, rows, sees
from ros_graph import HERE, LONG, Graph, Process, run_in_thread
from server import Fault, Server

SRC = HERE.parents[1] / "src"
PAGE = (HERE.parents[1] / "docs" / "perception.md").read_text()
TOPIC = "/camera/image_raw"
CONNECTION = f"""\
robot: ros1
skills:
  is_in_room: {{detector: "openai-chat:eyes", image: {TOPIC}}}
"""
RAW = {"encoding": "rgb8", "width": 64, "height": 32, "step": 64 * 3, "data": rows("RGB").hex()}
PADDED = {**RAW, "encoding": "bgr8", "step": 64 * 3 + 8, "data": rows("BGR", 8).hex()}
JPEG = {"format": "bgr8; jpeg compressed bgr8", "data": encoded("JPEG").hex()}
PNG = {"format": "png", "data": encoded("PNG").hex()}
PROGRAM = """def task_program():
    say("I see the mug" if is_in_room("mug") else "no mug")
    say("I see the cat" if is_in_room("cat") else "no cat")
"""
WAITS = Timeouts(patience=1.5, silence=1.5, longest=20.0)
BOTH = pytest.mark.parametrize("kind", ["ros1", "rosbridge"])


@pytest.fixture
def model(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    with Server(answer=sees) as served:
        monkeypatch.setenv("OPENAI_BASE_URL", served.url)
        yield served


class Eyes:
    """A robot whose only skill looks through a camera."""

    def __init__(self, graph: Graph, folder: Path, end: ExitStack) -> None:
        self.graph, self.folder, self._end = graph, folder, end

    def robot(self, kind: str = "ros1", topic: str = TOPIC) -> RosRobot:
        path = self.folder / "robot.yaml"
        path.write_text(CONNECTION.replace("ros1", kind).replace(TOPIC, topic))
        connection = read_connection(path, SKILLS)
        if kind == "ros1":
            robot = kinds.ros1(Options(address=self.graph.uri, connection=connection), WAITS)
        else:
            double = self._end.enter_context(bridge(ros_handler(self.graph.uri, ())))
            robot = kinds.rosbridge(Options(address=double.address, connection=connection), WAITS)
        self._end.callback(robot.disconnect)
        robot.connect()
        return robot


@pytest.fixture
def eyes(graph: Graph, tmp_path: Path) -> Iterator[Eyes]:
    with ExitStack() as end:
        yield Eyes(graph, tmp_path, end)


def start_camera(graph: Graph, kind: str, fields: dict[str, Any], topic: str = TOPIC) -> Process:
    """Start a camera that publishes until its end."""
    process = Process(HERE / "camera.py", topic, kind, json.dumps(fields), master=graph.uri)
    graph.processes.append(process)
    process.expect("ready")
    return process


def subscribed_topics(graph: Graph) -> list[str]:
    """Return the topics that have subscribers."""
    with ServerProxy(graph.uri) as master:
        answer: Any = master.getSystemState("/test")
    return [topic for topic, _ in answer[2][1]]


@pytest.mark.parametrize(
    ("kind", "message", "fields"),
    [
        ("ros1", "Image", RAW),
        ("ros1", "CompressedImage", JPEG),
        ("rosbridge", "Image", PADDED),  # The same code reads messages from both.
        ("rosbridge", "CompressedImage", PNG),
    ],
)
def test_camera_becomes_an_answer_and_a_picture(
    eyes: Eyes, model: Server, kind: str, message: str, fields: dict[str, Any]
) -> None:
    start_camera(eyes.graph, message, fields)
    robot = eyes.robot(kind)
    assert [*robot.skills] == ["is_in_room"]
    pictures: list[str | CameraPicture] = []
    assert robot.perform("is_in_room", ["mug"], pictures.append) is True
    (picture,) = pictures
    assert isinstance(picture, CameraPicture)
    assert has_frame(picture.data)
    assert robot.perform("is_in_room", ["cat"]) is False
    assert len(model.requests) == 2
    until = time.monotonic() + LONG
    while TOPIC in subscribed_topics(eyes.graph):
        assert time.monotonic() < until, "the robot still subscribes to the camera"
        time.sleep(0.05)


@pytest.mark.usefixtures("model")
def test_mission_keeps_what_the_robot_saw(graph: Graph, tmp_path: Path) -> None:
    start_camera(graph, "Image", RAW)
    others = graph.serve(*(skill for name, skill in SKILLS.items() if name != "is_in_room"))
    (tmp_path / "look.py").write_text(PROGRAM)
    ((file, command),) = re.findall(r"```yaml\n(.*?)```.*?```sh\ncodebotler (.*?)\n```", PAGE, re.DOTALL)
    (tmp_path / "robot.yaml").write_text(file)
    environment = {**os.environ, "PYTHONPATH": str(SRC), "CODEBOTLER_HOME": str(tmp_path),
                   "ROS_MASTER_URI": graph.uri}  # fmt: skip

    def tool(*arguments: str) -> str:
        with Forked("codebotler", *arguments, cwd=tmp_path, environment=environment) as running:
            out, err = running.communicate()
            assert running.returncode == 0, err + out
            return out + err

    watched = tool(*command.split(), "--yes")
    for text in ("I see the mug", "no cat"):
        others.expect("goal", text)
    (folder,) = (tmp_path / "missions").iterdir()
    lines = read_events(folder)
    kinds = [line["event"] for line in lines if line.get("skill") == "is_in_room"]
    assert kinds == ["skill", "picture", "result"] * 2
    assert [line["file"] for line in lines if line["event"] == "picture"] == [
        "pictures/1.jpg",
        "pictures/2.jpg",
    ]
    shown = tool("missions", "last")
    for text in (watched, shown):
        assert "picture: pictures/1.jpg" in text
    tool("missions", "last", "--mcap", "look.mcap")
    messages = make_reader(io.BytesIO((tmp_path / "look.mcap").read_bytes())).iter_messages(
        ["/skill/is_in_room/picture"]
    )
    kept = []
    for schema, _, message in messages:
        assert schema is not None
        assert schema.name == "foxglove.CompressedImage"
        kept.append(base64.b64decode(json.loads(message.data)["data"]))
    assert kept == [(folder / "pictures" / f"{number}.jpg").read_bytes() for number in (1, 2)]


@BOTH
@pytest.mark.usefixtures("model")
def test_missing_and_old_pictures_are_reported(eyes: Eyes, kind: str) -> None:
    robot = eyes.robot(kind)
    with pytest.raises(RobotError, match=TOPIC):
        robot.perform("is_in_room", ["mug"])
    filming = start_camera(eyes.graph, "Image", RAW)
    assert robot.perform("is_in_room", ["mug"])
    filming.end()
    with pytest.raises(RobotError, match=rf"no picture arrived on {TOPIC}|{TOPIC} came \d s ago") as error:
        robot.perform("is_in_room", ["mug"])
    assert error.value.kind == "IsInRoomFailed"
    start_camera(eyes.graph, "Image", RAW)
    assert robot.perform("is_in_room", ["mug"])


@BOTH
@pytest.mark.usefixtures("model")
def test_messages_without_a_picture_are_reported(eyes: Eyes, kind: str) -> None:
    start_camera(eyes.graph, "String", {}, topic="/words")
    start_camera(eyes.graph, "Image", {**RAW, "encoding": "16UC1"}, topic="/depth")
    start_camera(eyes.graph, "CompressedImage", {"format": "jpeg", "data": "00ff"}, topic="/noise")
    for topic, sentence in (
        ("/words", "/words is not an image message"),
        ("/depth", '/depth .*"16UC1"; use one of rgb8'),
        ("/noise", "/noise .*not a JPEG, PNG or WebP file"),
    ):
        robot = eyes.robot(kind, topic)
        with pytest.raises(RobotError) as error:
            robot.perform("is_in_room", ["mug"])
        assert re.search(sentence, str(error.value))
        robot.disconnect()


def test_failing_model_is_reported_and_may_recover(eyes: Eyes, model: Server) -> None:
    start_camera(eyes.graph, "Image", RAW)
    robot = eyes.robot()
    model.fault = lambda _: Fault.NOT_FOUND
    with pytest.raises(RobotError) as error:
        robot.perform("is_in_room", ["mug"])
    assert error.value.kind == "IsInRoomFailed"
    assert re.search("openai-chat:eyes: .*status 404", str(error.value))
    model.fault = lambda _: None
    assert robot.perform("is_in_room", ["mug"])
    with pytest.raises(RobotError, match='label "" is not valid'):
        robot.perform("is_in_room", [""])


def test_look_that_is_cancelled_ends_at_once(eyes: Eyes, model: Server) -> None:
    start_camera(eyes.graph, "Image", RAW)
    model.pause = 2.0
    robot = eyes.robot()
    with run_in_thread(lambda: robot.perform("is_in_room", ["mug"])) as ended:
        while not model.open:
            time.sleep(0.01)
        began = time.monotonic()
        robot.cancel()
    assert isinstance(ended["error"], CancelledError)
    assert time.monotonic() - began < 1.0
    robot.connect()
    assert robot.perform("is_in_room", ["mug"])


# --- pictures that a server shows


SHOWS = """
import sys
sys.path.insert(0, sys.argv[1])
import os, threading, time
import actionlib, rospy
from sensor_msgs.msg import CompressedImage
from message_types import action_types

def look(goal):
    if goal.object == "late":
        threading.Timer(0.2, show, [picture]).start()
    elif goal.object == "three":
        for _ in range(3):
            show(picture)
            time.sleep(0.1)
    server.set_succeeded()

def show(data):
    topic.publish(CompressedImage(format="jpeg", data=data))

picture = b"no picture at all"
rospy.init_node("eyes", disable_signals=True, log_level=rospy.FATAL)
spec = action_types([{"type": "IsInRoom", "definition": sys.argv[2]}])["IsInRoom"]
server = actionlib.SimpleActionServer("/is_in_room_server", spec, look, auto_start=False)
topic = rospy.Publisher("/is_in_room_server/picture", CompressedImage, queue_size=4)
server.start()
print('["ready"]', flush=True)
sys.stdin.read()
os._exit(0)
"""


def test_any_server_may_show_pictures(graph: Graph, tmp_path: Path) -> None:
    action = SKILLS["is_in_room"].ros
    assert action is not None
    script = tmp_path / "eyes.py"
    script.write_text(SHOWS)
    process = Process(script, str(WORKERS_FOLDER), action.definition, master=graph.uri)
    graph.processes.append(process)
    process.expect("ready")
    robot = graph.robot(skills=SkillTable((SKILLS["is_in_room"],)))
    robot.connect()

    def look(label: str) -> list[str | CameraPicture]:
        found: list[str | CameraPicture] = []
        assert robot.perform("is_in_room", [label], found.append) is False
        return found

    assert look("late") == [CameraPicture(b"no picture at all")]
    assert look("three") == [CameraPicture(b"no picture at all")] * 3
    began = time.monotonic()
    assert look("nothing") == []
    assert time.monotonic() - began < 1.0
