"""A mission stores pictures unchanged, within limits, names them in its events, and exports them."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Sequence
from pathlib import Path

import pytest
from mcap.reader import make_reader

from codebotler.missions.display.wording import event_text
from codebotler.missions.live import LiveRobot
from codebotler.missions.mission import Mission
from codebotler.missions.storage import pictures as module
from codebotler.missions.storage.log import LogLine, MissionState, read_events
from codebotler.missions.storage.mcap import write_mcap
from codebotler.missions.storage.pictures import PictureStore, read_picture
from codebotler.robots.base import CameraPicture, Feedback, RobotArgument, RobotResult, ignore_feedback
from codebotler.robots.reservation import Reservation
from doubles import FakeRobot

JPEG, PNG = b"\xff\xd8\xff and more", b"\x89PNG\r\n\x1a\n and more"
PROGRAM = "def task_program():\n    is_in_room('mug')\n"


class CameraRobot(FakeRobot):
    """A robot that shows pictures while it looks."""

    def __init__(self, *pictures: bytes) -> None:
        super().__init__(lambda *_: True)
        self.pictures = pictures

    def perform(
        self, skill: str, arguments: Sequence[RobotArgument], feedback: Feedback = ignore_feedback
    ) -> RobotResult:
        for data in self.pictures:
            feedback(CameraPicture(data))
        return super().perform(skill, arguments, feedback)


def mission_with(home: Path, *pictures: bytes) -> tuple[Mission, list[LogLine]]:
    with Reservation(CameraRobot(*pictures), home) as reserved, Mission(home, "showing") as mission:
        mission.set_program(PROGRAM)
        mission.record_check([])
        mission.approve()
        mission.run(reserved)
    return mission, [line for line in read_events(mission.folder) if line["event"] == "picture"]


def test_pictures_are_stored_unchanged_and_named_in_events(tmp_path: Path) -> None:
    mission, lines = mission_with(tmp_path, JPEG, PNG, JPEG)
    names = ["pictures/1.jpg", "pictures/2.png", "pictures/3.jpg"]
    assert [line["file"] for line in lines] == names
    assert [(line["number"], line["skill"]) for line in lines] == [(1, "is_in_room")] * 3
    assert [(mission.folder / name).read_bytes() for name in names] == [JPEG, PNG, JPEG]
    assert len(list((mission.folder / "pictures").iterdir())) == 3
    assert [event_text(line) for line in lines] == [f"picture: {name}" for name in names]


def test_events_say_which_pictures_were_not_stored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_STORED_PICTURE_BYTES", 20)
    monkeypatch.setattr(module, "MAX_MISSION_PICTURE_BYTES", 2 * len(JPEG))
    mission, lines = mission_with(tmp_path, b"<svg onload=alert(1)>", b"", JPEG + b"!" * 20, JPEG, JPEG, JPEG)
    assert mission.state is MissionState.DONE
    kept = [line.get("file") or line["text"] for line in lines]
    assert kept[3:5] == ["pictures/1.jpg", "pictures/2.jpg"]
    for text, named in zip(
        [*kept[:3], *kept[5:]],
        [["21 bytes", "JPEG nor PNG"], ["0 bytes", "JPEG nor PNG"], ["32 bytes", "20"], ["24 bytes"]],
        strict=True,
    ):
        assert all(name in text for name in ["picture", "not stored", *named]), text
    assert event_text(lines[0]) == lines[0]["text"]


def test_picture_that_cannot_be_written_stops_the_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_self: PictureStore, _data: bytes) -> dict[str, str]:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(PictureStore, "keep", full)
    mission, _ = mission_with(tmp_path, JPEG)
    assert (mission.state, "No space left on device" in mission.summary.reason) == (MissionState.FAILED, True)


def test_listener_receives_the_picture() -> None:
    notes: list[tuple[str, object]] = []

    def note(event: str, /, **data: object) -> None:
        notes.append((event, data.get("picture")))

    live = LiveRobot(CameraRobot(JPEG), note)
    assert live.perform("is_in_room", ["mug"]) is True
    assert ("picture", JPEG) in notes


@pytest.mark.parametrize(
    "name",
    ["../secret.jpg", "pictures/../../secret.jpg", "/etc/passwd", "pictures/1.jpg\n", "pictures/9.jpg", 7],
)
def test_file_outside_the_pictures_folder_is_not_read(tmp_path: Path, name: object) -> None:
    mission, (line,) = mission_with(tmp_path, JPEG)
    (tmp_path / "secret.jpg").write_bytes(JPEG)
    assert read_picture(mission.folder, line) == ("jpg", JPEG)
    assert read_picture(mission.folder, {**line, "file": name}) is None
    assert read_picture(mission.folder, {**line, "event": "log"}) is None


def test_pictures_are_images_for_foxglove(tmp_path: Path) -> None:
    mission, lines = mission_with(tmp_path, JPEG, b"none", PNG)
    assert len(lines) == 3
    file = io.BytesIO()
    write_mcap(file, mission.summary, read_events(mission.folder), folder=mission.folder)
    reader = make_reader(io.BytesIO(file.getvalue()))
    found = list(reader.iter_messages(["/skill/is_in_room/picture"]))
    for (schema, channel, message), line, data, kind in zip(
        found, (lines[0], lines[2]), (JPEG, PNG), ("jpeg", "png"), strict=True
    ):
        assert schema is not None
        assert (schema.name, schema.encoding, channel.message_encoding) == (
            "foxglove.CompressedImage",
            "jsonschema",
            "json",
        )
        at = round(line["time"] * 1e9)
        assert message.log_time == at
        assert json.loads(message.data) == {
            "timestamp": {"sec": at // 10**9, "nsec": at % 10**9},
            "frame_id": "",
            "data": base64.b64encode(data).decode(),
            "format": kind,
        }
        properties = json.loads(schema.data)["properties"]
        assert set(properties) == {"timestamp", "frame_id", "data", "format"}
        assert properties["data"]["contentEncoding"] == "base64"
    texts = [
        json.loads(message.data)["text"]
        for _, _, message in reader.iter_messages(["/skill/is_in_room"])
        if json.loads(message.data)["event"] == "picture"
    ]
    assert texts == ["pictures/1.jpg", lines[1]["text"], "pictures/2.png"]
