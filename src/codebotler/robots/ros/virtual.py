"""The virtual robot, a simulated robot that offers its skills on a real ROS graph."""

from __future__ import annotations

import os
import queue
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from urllib.parse import urlsplit

from codebotler.core.errors import RobotError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.world import World
from codebotler.robots.base import ROS_PYTHON, CancelledError, RobotArgument, RobotLostError
from codebotler.robots.ros.caller import calls_data
from codebotler.robots.ros.connections.connection import default_connection
from codebotler.robots.ros.kinds import choose_python, domain_of, master_uri
from codebotler.robots.ros.worker import RosWorker, WorkerMessage
from codebotler.robots.simulated import Simulated

VIRTUAL_NODE = "virtual_robot"
LOOPBACK_HOSTS = ("localhost", "127.0.0.1")
LISTEN_SECONDS = 3600.0  # the time limit of a single wait for a message


class VirtualRobot:
    """Offers skills as ROS actions and performs their goals in the simulator, one after the other.

    On ROS 1, it starts a master on this machine if none answers. On ROS 2, only this machine can reach it,
    unless ROS_AUTOMATIC_DISCOVERY_RANGE is set.

    Args:
        world: the world that the robot works in.
        speed: the robot's clock seconds per real second, or None to skip all waits.
        ros: the version of ROS, 1 or 2.
        address: the URI of a ROS 1 master or a ROS 2 domain number, or "" for the default.
        python: a Python interpreter with rclpy, or with rospy (and rosmaster to start a master).
        show: a callback that receives a line of text when a goal starts and when it ends.
        skills: the skills to offer.

    Raises:
        UserError: the speed is out of range, or the address is invalid.
    """

    def __init__(
        self,
        world: World,
        *,
        speed: float | None = 1.0,
        ros: int = 1,
        address: str = "",
        python: Path = ROS_PYTHON,
        show: Callable[[str], None] = lambda _: None,
        skills: SkillTable = SKILLS,
    ) -> None:
        self._python, self._show = python, show
        if ros == 1:
            self.address = master_uri(address)
        else:
            self.address, self._python = domain_of(address), choose_python(python)
        self._ros = ros
        self._body = Simulated(world, speed=speed, skills=skills)
        self._body.connect()
        self._goals: queue.SimpleQueue[WorkerMessage | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._current = ""
        self._cancelled: set[str] = set()
        self._worker: RosWorker | None = None
        self._threads: list[threading.Thread] = []
        self._ended = threading.Event()

    def start(self) -> bool:
        """Offer the skills. Return whether this started a master. Raise NotReadyError if ROS is missing."""
        worker = self._worker = self._start_servers()
        jobs = (self._listen, self._work)
        self._threads = [threading.Thread(target=job, args=(worker,), daemon=True) for job in jobs]
        for thread in self._threads:
            thread.start()
        return bool(worker.about["has_master"])

    def wait(self) -> None:
        """Serve goals until the worker dies, then raise RobotLostError."""
        self._ended.wait()
        assert self._worker is not None, "the robot was not started"
        raise RobotLostError(f"the virtual robot's worker has died ({self._worker.describe_end()})")

    def stop(self) -> None:
        """Stop the current skill and leave the ROS graph."""
        self._body.cancel()
        if self._worker is not None:
            self._worker.leave()
        for thread in self._threads:
            thread.join(LISTEN_SECONDS)

    def _start_servers(self) -> RosWorker:
        actions = calls_data(default_connection(self._body.skills))
        start: WorkerMessage = {"node": VIRTUAL_NODE, "actions": actions}
        if self._ros == 1:
            where = urlsplit(self.address)
            port = start["port"] = where.port if where.hostname in LOOPBACK_HOSTS else None
            environment = {"ROS_MASTER_URI": self.address}
            if port is not None and not {"ROS_IP", "ROS_HOSTNAME"} & os.environ.keys():
                environment["ROS_HOSTNAME"] = "localhost"
            return RosWorker(self._python, "servers.py", start, environment)
        reach = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        environment = {"ROS_DOMAIN_ID": self.address, "ROS_AUTOMATIC_DISCOVERY_RANGE": reach}
        return RosWorker(self._python, "ros2_servers.py", start, environment)

    def _listen(self, worker: RosWorker) -> None:
        while True:
            match worker.receive(LISTEN_SECONDS):
                case {"is": "goal"} as goal:
                    self._goals.put(goal)
                case {"is": "cancel", "id": str(number)}:
                    self._cancel(number)
                case {"is": "ended"}:
                    self._goals.put(None)
                    self._ended.set()
                    return

    def _cancel(self, number: str) -> None:
        with self._lock:
            self._cancelled.add(number)
            if number == self._current:
                self._body.cancel()

    def _work(self, worker: RosWorker) -> None:
        for goal in iter(self._goals.get, None):
            number, skill = goal["id"], goal["skill"]
            arguments = [tuple(a) if isinstance(a, list) else a for a in goal["arguments"]]
            self._show(f"{skill}({', '.join(map(str, arguments))})")
            with self._lock:
                is_wanted = number not in self._cancelled
                self._current = number
                self._body.clock.restart()  # the last goal may have been cancelled
            ending = self._ending(skill, arguments) if is_wanted else {"do": "cancelled"}
            self._show("  " + " ".join(str(part) for part in ending.values()))
            worker.send({**ending, "id": number})

    def _ending(self, skill: str, arguments: Sequence[RobotArgument]) -> WorkerMessage:
        try:
            return {"do": "succeed", "value": self._body.perform(skill, arguments)}
        except RobotError as error:
            return {"do": "abort", "text": f"{error.kind}: {error}"}
        except CancelledError:
            return {"do": "cancelled"}
