"""A robot as a file of `--connect` describes it, with places, a pose, and what it offers on ROS."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from typing import Any

from codebotler.core.errors import RobotError, UserError
from codebotler.core.world import Point
from codebotler.perception import Detector, PerceptionError, boxed, image_from_ros, jpeg_of, open_detector
from codebotler.robots.base import (
    Argument,
    CancelledError,
    Feedback,
    NotReadyError,
    Options,
    Picture,
    Result,
    no_feedback,
)
from codebotler.robots.places import Place, Places
from codebotler.robots.ros.connection import SkillCall
from codebotler.robots.ros.keepout import keepout
from codebotler.robots.ros.motion import Pose
from codebotler.robots.ros.robot import RosRobot, Waits
from codebotler.simulator.house_rule import Rule

BEAT = 0.05  # seconds between two looks at what it reports
CLOSES = 1.0  # seconds for detectors to close; one that looks closes later
BY_HAND = "STOP THE ROBOT BY HAND"


class ConnectedRobot(RosRobot):
    """A robot on ROS whose skills are what its connection maps them to; the options name the connection.

    Whether it stands still after a stop is seen from its pose or velocity, not from the answer to a cancel.
    """

    def __init__(
        self,
        name: str,
        address: str,
        script: str,
        options: Options,
        environment: Mapping[str, str],
        *,
        waits: Waits | None = None,
    ) -> None:
        super().__init__(name, address, script, options, environment, waits=waits)
        self.has_pose = self.connection.pose is not None
        self._detectors: dict[str, Detector] = {}
        self._looking = threading.Lock()  # held by one look, perhaps one that nobody waits for any more

    def connect(self) -> None:
        """Open what looks at pictures, and connect.

        Raises:
            NotReadyError: something is missing, or the poses are not in the frame of the places.
        """
        self.disconnect()
        for _, model in self.connection.cameras.values():
            if model not in self._detectors:
                self._detectors[model] = open_detector(model)
        super().connect()
        places, pose = self.connection.places, self._pose() if self.has_pose else None
        sentence = ""
        if self.has_pose and pose is None:
            sentence = f"no pose has come on {self._topic}; start what publishes it, or correct its name"
        elif places is not None and pose is not None and pose.frame not in {"", places.frame}:
            sentence = (
                f'the poses on {self._topic} are in the frame "{pose.frame}", but the places are in '
                f'"{places.frame}"; name another topic, or tf, under pose'
            )
        if sentence:
            self.disconnect()
            raise NotReadyError(sentence)

    def perform(self, skill: str, arguments: Sequence[Argument], feedback: Feedback = no_feedback) -> Result:
        """Answer from places and pose, look at a picture, or have the robot perform the skill.

        Raises:
            RobotError: the robot cannot do it.
            CancelledError: it was cancelled; `failed_stop` tells whether the robot stands still.
            RobotLostError: something died or does not answer.
        """
        connection = self.connection
        if skill in connection.cameras:
            topic, model = connection.cameras[skill]
            return self._look(topic, model, str(arguments[0]), feedback)
        if skill not in connection.calls and (places := connection.places) is not None:
            names = [place.name for place in places.places]
            return names if skill == "get_all_rooms" else self._place(places, feedback).name
        names = [parameter.name for parameter in self.skills[skill].parameters]
        values: dict[str, Any] = dict(zip(names, arguments, strict=True))
        if connection.places is not None and arguments and self.skills[skill].is_drive:
            values |= _of_place(connection.places, str(arguments[0]))
        return self._called(skill, values, feedback)

    @property
    def failed_stop(self) -> str:
        """After a stop: that the robot goes on moving; empty if it stands still, or nothing tells."""
        worker, until = self._worker, time.monotonic() + self._waits.patience * 0.8
        if worker is None or (self.connection.pose is None and self.connection.velocity is None):
            return ""
        motion = worker.motion
        while not motion.is_still and not motion.is_silent and time.monotonic() < until:
            time.sleep(BEAT)
        return f"it was told to stop but is still moving: {BY_HAND}" if motion.is_moving else ""

    def watch(self, told: Callable[[Point | None], None]) -> bool:
        """Call `told` with each pose until the connection ends, and None where it moves without any.

        Returns:
            whether it has poses.
        """
        worker = self._worker

        def watch() -> None:
            last: Pose | None = None
            while worker is not None and worker is self._worker:
                pose = worker.motion.pose
                if worker.motion.is_unseen:
                    told(None)
                elif pose is not None and pose is not last:
                    told((pose.x, pose.y))
                    last = pose
                time.sleep(BEAT)

        if self.has_pose:
            threading.Thread(target=watch, daemon=True).start()
        return self.has_pose

    def disconnect(self) -> None:
        """Have the worker cancel what goes on, and end it; close what looks at pictures."""
        was_connected = self._worker is not None
        super().disconnect()
        if was_connected:
            detectors, self._detectors = self._detectors, {}
            closing = threading.Thread(target=self._close, args=(detectors,), daemon=True)
            closing.start()
            closing.join(CLOSES)

    def _close(self, detectors: Mapping[str, Detector]) -> None:
        with self._looking:
            for detector in detectors.values():
                detector.close()

    def keep_out(self, rules: Sequence[Rule]) -> None:
        """Have the robot's planner keep out of rooms that rules forbid, if its connection says how."""
        places, topics = self.connection.places, self.connection.keepout
        if places is None or topics is None:
            return
        messages = keepout(rules, places.world().rooms, places.frame, topics[0])
        for topic, message in zip(topics, messages, strict=True):
            self._sent({"do": "publish", "topic": topic, "fields": message})

    @property
    def _topic(self) -> str:
        return "" if self.connection.pose is None else self.connection.pose.topic

    def _pose(self) -> Pose | None:
        """The last pose, waiting for the first one."""
        worker, until = self._worker, time.monotonic() + self._waits.patience
        while worker is not None and worker.motion.pose is None and time.monotonic() < until:
            if self._stopped:
                raise CancelledError
            time.sleep(BEAT)
        return None if worker is None else worker.motion.pose

    def _place(self, places: Places, feedback: Feedback) -> Place:
        """The place where the robot is: whose polygon holds it, or else the nearest, which is said."""
        pose = self._pose()
        if pose is None or (self._worker is not None and self._worker.motion.is_unseen):
            raise RobotError("UnknownPose", f"no pose has come on {self._topic} since the robot moved")
        within = places.room_at(pose.x, pose.y)
        if within is not None:
            return within
        nearest = places.nearest(pose.x, pose.y)
        away = math.dist((pose.x, pose.y), (nearest.x, nearest.y))
        feedback(f"the robot is {away:.1f} m from {nearest.name}, the nearest place")
        return nearest

    def _look(self, topic: str, model: str, label: str, feedback: Feedback) -> bool:
        """Look for something in a camera's next picture, unless the robot is stopped."""
        call = SkillCall("topic", topic, "", failure="IsInRoomFailed")
        seen = self._received(call, {"do": "look", "topic": topic}, no_feedback)
        found, detector = Future[tuple[bool, bytes]](), self._detectors[model]

        def look() -> None:
            try:
                with self._looking:
                    found.set_result(_seen(detector, seen, label, topic))
            except Exception as error:  # noqa: BLE001 - which is raised again below
                found.set_exception(error)

        threading.Thread(target=look, daemon=True).start()
        while not found.done():
            if self._stopped:
                raise CancelledError
            time.sleep(BEAT)
        try:
            is_there, picture = found.result()
        except (UserError, PerceptionError) as error:
            raise RobotError(call.failure, str(error)) from None
        feedback(Picture(picture))
        return is_there


def _seen(detector: Detector, message: Mapping[str, Any], label: str, topic: str) -> tuple[bool, bytes]:
    """Whether something is in a picture, and the picture with a box around it."""
    image = image_from_ros(message, f"the picture on {topic}")
    sighting = detector.look(image, label)
    return sighting.found, jpeg_of(boxed(image, sighting))


def _of_place(places: Places, text: str) -> dict[str, Any]:
    """The values of the variables that speak of the place that a text names."""
    place = places.named(text)
    if place is None:
        known = ", ".join(one.name for one in places.places)
        raise RobotError("GoToInvalidLocation", f'there is no place "{text}"; there are: {known}')
    half = place.yaw / 2
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)}
    pose = {"position": {"x": place.x, "y": place.y, "z": 0.0}, "orientation": turn}
    stamped = {"header": {"frame_id": places.frame}, "pose": pose}
    numbers = {"place.x": place.x, "place.y": place.y, "place.yaw": place.yaw}
    return {"place": stamped, "place.pose": pose, **numbers}
