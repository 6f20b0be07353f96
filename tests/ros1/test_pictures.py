"""Pictures on a real graph: from a camera through a model that sees, and into the log of a mission."""

from __future__ import annotations

import base64
import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from PIL import Image

from codebotler.core.errors import RobotError
from codebotler.core.skills.paper import SKILLS
from codebotler.missions.log import events_of
from codebotler.perception import image_of
from codebotler.robots.base import ROS_PYTHON, CancelledError, Picture
from codebotler.robots.ros.robot import Waits
from codebotler.robots.ros.worker import WORKERS
from ros_graph import LONG, Graph, Process, free_port, started
from server import Fault, Request, Server

ROOT = Path(__file__).parents[2]
EXAMPLE, CAMERA = ROOT / "examples" / "is_in_room_server.py", Path(__file__).with_name("camera.py")
TOPIC = "/camera/image_raw"
RED, BLUE = (254, 0, 0), (0, 0, 254)
BOX = [0.5, 0.0, 1.0, 1.0]
PROGRAM = """def task_program():
    say("I see the mug" if is_in_room("mug") else "no mug")
    say("I see the cat" if is_in_room("cat") else "no cat")
"""


def halves() -> Image.Image:
    """A picture that is red on the left and blue on the right."""
    image = Image.new("RGB", (64, 32), RED)
    image.paste(BLUE, (32, 0, 64, 32))
    return image


def encoded(kind: str) -> bytes:
    file = io.BytesIO()
    halves().save(file, kind, quality=95)
    return file.getvalue()


def raw(order: str, padding: int = 0) -> dict[str, Any]:
    mode = {"rgb8": "RGB", "bgr8": "BGR"}[order]
    whole, width = halves().tobytes("raw", mode), 64 * 3
    rows = [whole[at : at + width] + bytes(padding) for at in range(0, len(whole), width)]
    return {
        "encoding": order,
        "width": 64,
        "height": 32,
        "step": width + padding,
        "data": b"".join(rows).hex(),
    }


def sees(request: Request) -> str:
    """A model that sees a mug on the right of a picture whose right is blue, and else nothing."""
    text, picture = request.body["messages"][1]["content"]
    image = image_of(base64.b64decode(picture["image_url"]["url"].partition(",")[2]))
    left, right = image.getpixel((8, 16)), image.getpixel((56, 16))
    assert isinstance(left, tuple)
    assert isinstance(right, tuple)
    is_there = json.loads(text["text"]) == "mug" and right[2] > 200 > left[2] and left[0] > 200 > right[0]
    return json.dumps({"found": is_there, "score": 0.9, "box": BOX if is_there else None})


@pytest.fixture
def model() -> Iterator[Server]:
    with Server(answer=sees) as served:
        yield served


@contextmanager
def looking(graph: Graph, model: Server, *arguments: str) -> Iterator[None]:
    """The example, as a user starts it."""
    command = [sys.executable, str(EXAMPLE), "--model", "openai-chat:eyes", "--base-url", model.url]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "ROS_MASTER_URI": graph.uri}
    with subprocess.Popen(
        [*command, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        said = process.stdout.readline()
        assert "ready, Ctrl-C ends it" in said, process.stderr.read()
        try:
            yield
        finally:
            process.send_signal(signal.SIGINT)
            status = process.wait(LONG)
    assert status == 0


def camera(graph: Graph, kind: str, fields: dict[str, Any], topic: str = TOPIC) -> Process:
    """A camera that publishes until it is ended."""
    process = Process(CAMERA, str(WORKERS), topic, kind, json.dumps(fields), master=graph.uri)
    graph.processes.append(process)
    process.expect("ready")
    return process


def asked(graph: Graph, label: str) -> tuple[bool, list[str | Picture]]:
    """What a robot answers, and what it showed meanwhile."""
    robot = graph.robot()
    told: list[str | Picture] = []
    robot.connect()
    try:
        found = robot.perform("is_in_room", [label], told.append)
    finally:
        robot.disconnect()
    assert isinstance(found, bool)
    return found, told


@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        ("sensor_msgs/Image", raw("rgb8")),
        ("sensor_msgs/Image", raw("bgr8", padding=8)),
        (
            "sensor_msgs/CompressedImage",
            {"format": "bgr8; jpeg compressed bgr8", "data": encoded("JPEG").hex()},
        ),
        ("sensor_msgs/CompressedImage", {"format": "png", "data": encoded("PNG").hex()}),
    ],
)
def test_camera_becomes_an_answer_and_a_picture(
    graph: Graph, model: Server, kind: str, fields: dict[str, Any]
) -> None:
    camera(graph, kind, fields)
    with looking(graph, model, "--topic", TOPIC):
        found, told = asked(graph, "mug")
        assert found
        (picture,) = told
        assert isinstance(picture, Picture)
        shown = image_of(picture.data)
        assert shown.size == (64, 32)
        on_frame, inside = shown.getpixel((33, 16)), shown.getpixel((48, 16))
        assert isinstance(on_frame, tuple)
        assert isinstance(inside, tuple)
        assert on_frame[1] > 90  # yellow, between red and blue
        assert inside[1] < 40
        assert asked(graph, "cat")[0] is False
    assert len(model.requests) == 2


def test_mission_keeps_what_the_robot_saw(graph: Graph, model: Server, tmp_path: Path) -> None:
    camera(graph, "sensor_msgs/Image", raw("rgb8"))
    others = graph.serve(*(skill for name, skill in SKILLS.items() if name != "is_in_room"))
    (tmp_path / "look.py").write_text(PROGRAM)
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "CODEBOTLER_HOME": str(tmp_path),
                   "ROS_MASTER_URI": graph.uri}  # fmt: skip

    def tool(*arguments: str) -> str:
        command = [sys.executable, "-m", "codebotler", *arguments]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr + done.stdout
        return done.stdout + done.stderr

    with looking(graph, model, "--topic", TOPIC):
        watched = tool("run", "look.py", "--robot", "ros1", "--yes")
    for text in ("", "", "I see the mug", "no cat"):
        others.expect("goal", text)
    (folder,) = (tmp_path / "missions").iterdir()
    lines = events_of(folder)
    kinds = [line["event"] for line in lines if line.get("skill") == "is_in_room"]
    assert kinds == ["skill", "picture", "result"] * 2
    assert [line["file"] for line in lines if line["event"] == "picture"] == [
        "pictures/1.jpg",
        "pictures/2.jpg",
    ]
    shown = tool("missions", "last")
    for text in (watched, shown):
        assert "picture: pictures/1.jpg" in text
    assert str(folder / "pictures") in shown
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


def test_picture_may_come_from_a_file(graph: Graph, model: Server, tmp_path: Path) -> None:
    path = tmp_path / "room.png"
    path.write_bytes(encoded("PNG"))
    with looking(graph, model, "--file", str(path)):
        found, told = asked(graph, "mug")
        assert found
        assert len(told) == 1
        path.write_bytes(encoded("PNG")[:90])
        with pytest.raises(RobotError, match=r"room\.png .*broken or cut off"):
            asked(graph, "mug")
        path.unlink()
        with pytest.raises(RobotError, match=r"room\.png: there is no such file"):
            asked(graph, "mug")


def test_no_picture_yet_and_no_picture_any_more_are_said(graph: Graph, model: Server) -> None:
    with looking(graph, model, "--topic", TOPIC, "--oldest", "3"):
        with pytest.raises(RobotError) as error:
            asked(graph, "mug")
        assert error.value.kind == "IsInRoomFailed"
        assert f"no picture has arrived on {TOPIC}" in str(error.value)
        filming = camera(graph, "sensor_msgs/Image", raw("rgb8"))
        assert asked(graph, "mug")[0]
        filming.end()
        time.sleep(3.0)
        with pytest.raises(RobotError, match=rf"{TOPIC} came \d s ago"):
            asked(graph, "mug")


def test_what_is_no_picture_is_said(graph: Graph, model: Server) -> None:
    camera(graph, "std_msgs/String", {}, topic="/words")
    camera(graph, "sensor_msgs/Image", {**raw("rgb8"), "encoding": "16UC1"}, topic="/depth")
    camera(graph, "sensor_msgs/CompressedImage", {"format": "jpeg", "data": "00ff"}, topic="/noise")
    for topic, sentence in (
        ("/words", "/words .*std_msgs/String.* sensor_msgs/Image or sensor_msgs/Comp"),
        ("/depth", '/depth .*"16UC1", not one of rgb8'),
        ("/noise", "/noise .*not a JPEG, PNG or WebP file"),
    ):
        with looking(graph, model, "--topic", topic, "--oldest", "1"), pytest.raises(RobotError) as error:
            asked(graph, "mug")
        assert re.search(sentence, str(error.value))


def test_model_that_is_down_is_said_and_may_come_back(graph: Graph, model: Server) -> None:
    camera(graph, "sensor_msgs/Image", raw("rgb8"))
    with looking(graph, model, "--topic", TOPIC):
        model.fault = lambda _: Fault.NOT_FOUND
        with pytest.raises(RobotError) as error:
            asked(graph, "mug")
        assert error.value.kind == "IsInRoomFailed"
        assert re.search("openai-chat:eyes: .*status 404", str(error.value))
        model.fault = lambda _: None
        assert asked(graph, "mug")[0]
        with pytest.raises(RobotError, match="label is empty"):
            asked(graph, "")


def test_look_that_is_cancelled_ends_at_once(graph: Graph, model: Server) -> None:
    camera(graph, "sensor_msgs/Image", raw("rgb8"))
    model.pause = 2.0
    with looking(graph, model, "--topic", TOPIC):
        robot = graph.robot()
        robot.connect()
        with started(lambda: robot.perform("is_in_room", ["mug"])) as ended:
            while not model.open:
                time.sleep(0.01)
            began = time.monotonic()
            robot.cancel()
        robot.disconnect()
        assert isinstance(ended["error"], CancelledError)
        assert time.monotonic() - began < 1.5
        model.pause = 0.0
        assert asked(graph, "mug")[0]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["recorded"], ["recorded does not accept pictures", "hf:PATH"]),
        (["openai-chat:eyes"], ["no ROS master", "http://localhost:"]),
        (["openai-chat:eyes", "--oldest", "nan"], ["--oldest is nan", "seconds"]),
        (["openai-chat:eyes", "--oldest", "0"], ["--oldest is 0", "seconds"]),
    ],
)
def test_what_keeps_it_from_serving_is_said(arguments: list[str], named: list[str]) -> None:
    command = [sys.executable, str(EXAMPLE), "--base-url", "http://localhost:1/v1", "--model", *arguments]
    master = f"http://localhost:{free_port()}"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "ROS_MASTER_URI": master}
    done = subprocess.run(
        [*command, "--topic", TOPIC], env=environment, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr.count("Traceback")) == (2, 0)
    assert all(name in done.stderr for name in ["error: ", *named]), done.stderr


# --- what a robot shows


SHOWS = """
import sys
sys.path.insert(0, sys.argv[1])
import base64, os, threading, time
import actionlib, rospy
from pictures import PictureTopic
from message_types import message_types

def look(goal):
    if goal.object == "late":
        threading.Timer(0.2, show.show, [picture]).start()
    elif goal.object == "huge":
        show.show(base64.b64encode(bytes(3_000_000)).decode())
    elif goal.object == "three":
        for _ in range(3):
            show.show(picture)
            time.sleep(0.1)
    server.set_succeeded()

picture = base64.b64encode(b"no picture at all").decode()
rospy.init_node("eyes", disable_signals=True, log_level=rospy.FATAL)
spec = message_types([{"type": "IsInRoom", "definition": sys.argv[2]}])["IsInRoom"]
server = actionlib.SimpleActionServer("/is_in_room_server", spec, look, auto_start=False)
show = PictureTopic("/is_in_room_server")
server.start()
print('["ready"]', flush=True)
sys.stdin.read()
os._exit(0)
"""


def test_any_server_may_show_what_it_sees(graph: Graph, tmp_path: Path) -> None:
    action = SKILLS["is_in_room"].ros
    assert action is not None
    script = tmp_path / "eyes.py"
    script.write_text(SHOWS)
    process = Process(script, str(WORKERS), action.definition, master=graph.uri)
    graph.processes.append(process)
    process.expect("ready")
    robot = graph.robot(waits=Waits(patience=1.5, silence=1.5, longest=20.0))
    robot.connect()

    def told(label: str) -> list[str | Picture]:
        heard: list[str | Picture] = []
        assert robot.perform("is_in_room", [label], heard.append) is False
        return heard

    assert told("late") == [Picture(b"no picture at all")]
    assert told("three") == [Picture(b"no picture at all")] * 3
    (left_out,) = told("huge")
    assert isinstance(left_out, str)
    assert "3,000,000 bytes" in left_out
    assert "2,000,000" in left_out
    began = time.monotonic()
    assert told("nothing") == []
    assert time.monotonic() - began < 1.0


def test_messages_made_in_memory_are_those_of_ros() -> None:
    code = (
        "from message_types import made_pictures; import json; t = made_pictures();"
        "made = [t.Image, t.CompressedImage];"
        "print(json.dumps({c._type: [c._md5sum, c._type, c.__slots__] for c in made}))"
    )
    done = subprocess.run(
        [str(ROS_PYTHON), "-c", code], cwd=WORKERS, capture_output=True, text=True, check=True
    )
    assert json.loads(done.stdout) == {  # as `rosmsg md5` and `rosmsg show` tell them
        "sensor_msgs/Image": [
            "060021388200f6f0f447d0fcd9c64743",
            "sensor_msgs/Image",
            ["header", "height", "width", "encoding", "is_bigendian", "step", "data"],
        ],
        "sensor_msgs/CompressedImage": [
            "8f7a12909da2c9d3332d540a0977563f",
            "sensor_msgs/CompressedImage",
            ["header", "format", "data"],
        ],
    }
