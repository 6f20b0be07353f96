"""A robot on ROS, with the calls, places, poses and cameras of a connection file, if there is one."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from codebotler.core.errors import RobotError, UserError
from codebotler.core.world import Point
from codebotler.robots.base import (
    STOP_BY_HAND,
    CameraPicture,
    CancelledError,
    Feedback,
    NotReadyError,
    RobotArgument,
    RobotResult,
    ignore_feedback,
)
from codebotler.robots.places import NamedPlace, Places
from codebotler.robots.ros.caller import RosCaller
from codebotler.robots.ros.connections.connection import SkillCall, Values
from codebotler.robots.ros.keepout import keepout_messages
from codebotler.robots.ros.motion import Pose
from codebotler.simulator.guard.house_rule import Rule

if TYPE_CHECKING:
    from codebotler.perception import Detector

POLL_SECONDS = 0.05  # the interval for checking conditions while waiting
CLOSE_SECONDS = 1.0  # how long to wait for detectors to close; a busy detector closes later


class RosRobot(RosCaller):
    """A robot on ROS with the calls, places and cameras of `options.connection`, or an action for each skill.

    After a stop, `failed_stop` uses the robot's pose or velocity to tell whether it really stands still.
    """

    _detectors: Mapping[str, Detector] = MappingProxyType({})  # by model, while the robot is connected

    @property
    def has_pose(self) -> bool:
        """Whether the connection names a topic with the robot's poses."""
        return bool(self.connection.pose)

    def connect(self) -> None:
        """Connect over ROS. Raise NotReadyError if no pose arrives, or its frame differs from the places'."""
        self.disconnect()
        if cameras := self.connection.cameras.values():
            from codebotler.perception import open_detector  # noqa: PLC0415 - slow, and optional

            self._looking = threading.Lock()  # held while a detector runs
            self._detectors = {model: open_detector(model) for model in {model for _, model in cameras}}
        super().connect()
        places, pose = self.connection.places, self._pose() if self.has_pose else None
        sentence = ""
        if self.has_pose and pose is None:
            sentence = f"no pose arrived on {self.connection.pose}; start its publisher, or correct the topic"
        elif places is not None and pose is not None and pose.frame not in {"", places.frame}:
            frames = f'are in the frame "{pose.frame}", but the places are in "{places.frame}"'
            mend = "name another topic, or tf, under pose"
            sentence = f"the poses on {self.connection.pose} {frames}; {mend}"
        if sentence:
            self.disconnect()
            raise NotReadyError(sentence)

    def perform(
        self, skill: str, arguments: Sequence[RobotArgument], feedback: Feedback = ignore_feedback
    ) -> RobotResult:
        """Perform a skill with a camera, the list of places or a ROS call, as the connection file says."""
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
            values |= _place_values(connection.places, str(arguments[0]))
        call = connection.calls.get(skill)
        if call is None:
            raise RobotError("SkillWithoutAction", f"the declaration of {skill} has no ROS action; add one")
        request = {"do": "perform", "skill": skill, "fields": call.fields(values)}
        result: RobotResult = call.answer(self._request(call, request, feedback))
        return result

    @property
    def failed_stop(self) -> str:
        """A warning if the robot is still moving seconds after a stop, or "" if no report shows that."""
        worker, until = self._worker, time.monotonic() + self._waits.patience * 0.8
        if worker is None or not (self.connection.pose or self.connection.velocity):
            return ""
        motion = worker.motion
        while not motion.is_still and not motion.is_silent and time.monotonic() < until:
            time.sleep(POLL_SECONDS)
        return f"the robot was told to stop but is still moving: {STOP_BY_HAND}" if motion.is_moving else ""

    def watch(self, on_pose: Callable[[Point | None], None]) -> bool:
        """Pass positions in metres (None if unknown) to `on_pose` until `disconnect`. Return `has_pose`."""
        worker = self._worker

        def watch() -> None:
            last: Pose | None = None
            while worker is not None and worker is self._worker:
                pose = worker.motion.pose
                if worker.motion.is_unseen:
                    on_pose(None)
                elif pose is not None and pose is not last:
                    on_pose((pose.x, pose.y))
                    last = pose
                time.sleep(POLL_SECONDS)

        if self.has_pose:
            threading.Thread(target=watch, daemon=True).start()
        return self.has_pose

    def disconnect(self) -> None:
        """Have the worker cancel its goal and exit, and close the detectors."""
        super().disconnect()
        detectors, self._detectors = self._detectors, {}
        if detectors:
            closing = threading.Thread(target=self._close, args=(detectors,), daemon=True)
            closing.start()
            closing.join(CLOSE_SECONDS)

    def _close(self, detectors: Mapping[str, Detector]) -> None:
        with self._looking:
            for detector in detectors.values():
                detector.close()

    def keep_out(self, rules: Sequence[Rule]) -> None:
        """Make the robot's planner avoid the rooms that rules forbid, if there is a keepout filter."""
        places, topics = self.connection.places, self.connection.keepout
        if places is None or topics is None:
            return
        messages = keepout_messages(rules, places.world().rooms, places.frame, topics[0])
        for topic, message in zip(topics, messages, strict=True):
            self._send({"do": "publish", "topic": topic, "fields": message})

    def _pose(self) -> Pose | None:
        """Return the last pose, or wait for the first one. Return None if no pose arrives in time."""
        worker, until = self._worker, time.monotonic() + self._waits.patience
        while worker is not None and worker.motion.pose is None and time.monotonic() < until:
            if self._stopped:
                raise CancelledError
            time.sleep(POLL_SECONDS)
        return None if worker is None else worker.motion.pose

    def _place(self, places: Places, feedback: Feedback) -> NamedPlace:
        """Return the place that the robot is in, or else the nearest place, whose distance is reported."""
        pose = self._pose()
        if pose is None or (self._worker is not None and self._worker.motion.is_unseen):
            message = f"no pose has arrived on {self.connection.pose} since the robot moved"
            raise RobotError("UnknownPose", message)
        within = places.room_at(pose.x, pose.y)
        if within is not None:
            return within
        nearest = places.nearest(pose.x, pose.y)
        away = math.dist((pose.x, pose.y), (nearest.x, nearest.y))
        feedback(f"the robot is {away:.1f} m from {nearest.name}, the nearest place")
        return nearest

    def _look(self, topic: str, model: str, label: str, feedback: Feedback) -> bool:
        """Return whether a detector finds something in a camera's next picture."""
        call = SkillCall("topic", topic, "", failure="IsInRoomFailed")
        image = self._request(call, {"do": "look", "topic": topic}, ignore_feedback)
        seen = Future[tuple[bool, bytes]]()
        threading.Thread(target=self._see, args=(seen, model, image, label, topic), daemon=True).start()
        while not seen.done():
            if self._stopped:
                raise CancelledError
            time.sleep(POLL_SECONDS)
        is_there, picture = seen.result()
        feedback(CameraPicture(picture))
        return is_there

    def _see(
        self, seen: Future[tuple[bool, bytes]], model: str, message: Values, label: str, topic: str
    ) -> None:
        """Set whether something is in a picture, and the picture with a box around what was found."""
        from codebotler.perception import PerceptionError, encode_jpeg, image_from_ros, with_box  # noqa: PLC0415 - slow

        try:
            image = image_from_ros(message, f"the picture on {topic}")
            with self._looking:
                sighting = self._detectors[model].look(image, label)
            seen.set_result((sighting.found, encode_jpeg(with_box(image, sighting))))
        except (UserError, PerceptionError) as error:
            seen.set_exception(RobotError("IsInRoomFailed", str(error)))
        except Exception as error:  # noqa: BLE001 - raised again where the result is used
            seen.set_exception(error)


def _place_values(places: Places, text: str) -> dict[str, Any]:
    """Return a place's values for variables such as `$place.x`, or raise RobotError if it is unknown."""
    place = places.named(text)
    if place is None:
        known = ", ".join(one.name for one in places.places)
        raise RobotError("GoToInvalidLocation", f'unknown place "{text}"; the known places are: {known}')
    half = place.yaw / 2
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)}
    pose = {"position": {"x": place.x, "y": place.y, "z": 0.0}, "orientation": turn}
    stamped = {"header": {"frame_id": places.frame}, "pose": pose}
    numbers = {"place.x": place.x, "place.y": place.y, "place.yaw": place.yaw}
    return {"place": stamped, "place.pose": pose, **numbers}
