"""A robot defined by a class in the user's file, with a plain or async method for each skill."""

from __future__ import annotations

import asyncio
import inspect
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import CancelledError as FutureCancelledError
from contextlib import suppress
from pathlib import Path
from traceback import extract_tb
from typing import Any

from codebotler.core.errors import RobotError, UserError
from codebotler.core.skills.files import load_skill_module
from codebotler.core.skills.table import Skill
from codebotler.core.skills.values import plain
from codebotler.core.text.words import listed
from codebotler.robots.base import (
    STOP_BY_HAND,
    CancelledError,
    Feedback,
    NotReadyError,
    Options,
    RobotArgument,
    RobotLostError,
    RobotResult,
    ignore_feedback,
)
from codebotler.robots.clock import Clock

STOP_SECONDS = 5.0  # the time limit for `stop`


def is_own(name: str) -> bool:
    """Return whether a robot's name refers to a class in a file, such as `lab_robot.py:Spot`."""
    return ".py:" in name


class OwnRobot:
    """Performs skills by calling the methods of an object of the user's class.

    The class needs `rooms()`, which lists the rooms, and `stop()`, which stops the robot at once and may be
    called by any thread while another method runs. To report a failure, a method raises RobotError or an
    exception named after an error that the skill declares. Any other exception ends the mission.

    Args:
        name: the file and the class, such as `lab_robot.py:Spot`.
        options: the options for opening the robot.

    Attributes:
        failed_stop: why the last stop failed, or "" if it succeeded or there was none.

    Raises:
        UserError: the file or class does not exist, or a required method is missing.
    """

    if_tool_dies = "nothing stops the robot unless its class does so"
    rooms_are_regexes = has_pose = False

    def __init__(self, name: str, options: Options) -> None:
        path, _, kind = name.rpartition(":")
        self.name, self.address, self.skills = kind, f"{Path(path).resolve()}:{kind}", options.skills
        self.clock = Clock(1.0)
        self._body = _make_body(Path(path), kind)
        methods = {skill: self._method(skill) for skill in self.skills}
        self._methods = {skill: method for skill, method in methods.items() if method is not None}
        for skill, method in self._methods.items():
            _expect_fit(kind, method, self.skills[skill])
        lacking = [skill for skill in self.skills if skill not in self._methods]
        self.missing: Mapping[str, str] = {skill: f"{kind} has no method {skill}" for skill in lacking}
        self._stopped = True
        self._is_busy = False
        self._stop_lock, self._stop_returned = threading.Lock(), threading.Event()
        self._stop_returned.set()
        self.failed_stop = ""
        self._loop: asyncio.AbstractEventLoop | None = None
        self._running: asyncio.Task[Any] | None = None  # a method that cancelling ends
        self._cancelled: asyncio.Task[Any] | None = None  # the last one that STOP has cancelled

    def _method(self, skill: str) -> Callable[..., Any] | None:
        """Return the method for a skill, or None. If there is no `get_all_rooms`, use `rooms` instead."""
        method = getattr(self._body, skill, None)
        if method is None and skill == "get_all_rooms":
            method = self._body.rooms
        return method if callable(method) else None

    def connect(self) -> None:
        """Call the user's `connect` method, if any, and reset `clock`. Raise NotReadyError if this fails."""
        if not self._stop_returned.is_set():
            raise NotReadyError(f"an earlier call of {self.name}.stop has not returned; check the robot")
        if self._loop is None:
            self._loop = asyncio.new_event_loop()
            self._thread = threading.Thread(target=_run, args=(self._loop,), daemon=True)
            self._thread.start()
        self._stopped, self.failed_stop = False, ""
        connect = getattr(self._body, "connect", None)
        if connect is not None:
            try:
                self._finish(connect())
            except Exception as error:
                raise NotReadyError(f"{self.name} did not connect: {_describe(error)}") from error
        self.clock.restart()

    def perform(
        self, skill: str, arguments: Sequence[RobotArgument], _: Feedback = ignore_feedback
    ) -> RobotResult:
        """Perform a skill by calling its method.

        Raises:
            RobotError: the skill failed.
            CancelledError: the robot was stopped.
            RobotLostError: the method failed unexpectedly, or the robot could not be stopped.
        """
        if self._stopped:
            raise CancelledError
        row = self.skills[skill]
        if skill not in self._methods:
            raise RobotError("SkillWithoutMethod", self.missing[skill])
        given = [each.type.convert(one) for each, one in zip(row.parameters, arguments, strict=True)]
        self._is_busy = True
        try:
            result: RobotResult = plain(self._finish(self._methods[skill](*given)))
        except Exception as error:
            self._expect_no_stop()
            kind = type(error).__name__
            if isinstance(error, RobotError):
                raise
            if kind in dict(row.fails):
                raise RobotError(kind, str(error) or f"{skill}: {dict(row.fails)[kind]}") from error
            self.cancel()
            failed = f"; {self.failed_stop}" if self.failed_stop else ""
            raise RobotLostError(f"{self.name}.{skill} failed: {_describe(error)}{failed}") from error
        finally:
            self._is_busy = False
        self._expect_no_stop()
        return result

    def _expect_no_stop(self) -> None:
        """If the robot was stopped, wait for `stop` and raise an error that says whether it succeeded."""
        if not self._stopped:
            return
        if not self._stop_returned.wait(STOP_SECONDS):
            late = f"has not returned after {STOP_SECONDS:.0f} s"
            raise RobotLostError(f"{self.name}.stop {late}; {STOP_BY_HAND}")
        if self.failed_stop:
            raise RobotLostError(self.failed_stop)
        raise CancelledError

    def cancel(self) -> None:
        """Call the user's `stop` method, wait up to 5 s for it, and cancel a running async method."""
        with self._stop_lock:
            self._stopped = True
            if self._stop_returned.is_set():
                self._stop_returned.clear()
                threading.Thread(target=self._call_stop, daemon=True).start()
        self.clock.stop()
        running, loop = self._running, self._loop
        if running is not None and loop is not None and running is not self._cancelled:
            self._cancelled = running  # another press must not end its clean-up
            loop.call_soon_threadsafe(running.cancel)
        if not self._stop_returned.wait(STOP_SECONDS):
            self.failed_stop = f"{self.name}.stop failed: it took too long; {STOP_BY_HAND}"

    def _call_stop(self) -> None:
        try:
            self._finish(self._body.stop(), STOP_SECONDS)
        except Exception as error:  # noqa: BLE001 - cancel must not raise
            why = "it took too long" if isinstance(error, TimeoutError) else _describe(error)
            self.failed_stop = f"{self.name}.stop failed: {why}; {STOP_BY_HAND}"
        else:
            self.failed_stop = ""
        finally:
            self._stop_returned.set()

    def disconnect(self) -> None:
        """Stop a running method, call the user's `disconnect` method, if any, and end the event loop."""
        if self._is_busy:
            self.cancel()
        self._stopped = True
        self.clock.stop()
        disconnect = getattr(self._body, "disconnect", None)
        if self._loop is None:
            return
        with suppress(Exception):  # the robot counts as disconnected in any case
            if disconnect is not None:
                self._finish(disconnect(), STOP_SECONDS)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._loop = None
        self._thread.join(STOP_SECONDS)

    def _finish(self, result: Any, patience: float | None = None) -> Any:  # noqa: ANN401 - of a user's method
        """Return the result of a method call. If the method is async, run it and wait for the result."""
        if not inspect.iscoroutine(result):
            return result
        assert self._loop is not None, "the robot is not connected"

        async def run() -> Any:  # noqa: ANN401 - as above
            if patience is None:
                self._running = asyncio.current_task()
                if self._stopped:  # just now, when there was nothing to cancel yet
                    result.close()
                    raise CancelledError
            return await result

        future = asyncio.run_coroutine_threadsafe(run(), self._loop)
        try:
            return future.result(patience)
        except FutureCancelledError:
            raise CancelledError from None
        except TimeoutError:
            future.cancel()
            raise
        finally:
            if patience is None:
                self._running = None


def _expect_fit(kind: str, method: Callable[..., Any], skill: Skill) -> None:
    """Raise UserError if a method does not accept the arguments of its skill."""
    code = getattr(method, "__code__", None)
    try:
        inspect.signature(method).bind(*(parameter.name for parameter in skill.parameters))
    except TypeError:
        takes = ", ".join(["self", *(parameter.name for parameter in skill.parameters)])
        file, line = (None, None) if code is None else (code.co_filename, code.co_firstlineno)
        sentence = f"{kind}.{skill.name} has the wrong parameters; write def {skill.name}({takes})"
        raise UserError(sentence, file=file, line=line) from None
    except ValueError:  # some built-in methods have no signature
        return


def _run(loop: asyncio.AbstractEventLoop) -> None:
    try:
        loop.run_forever()
        left = [task for task in asyncio.all_tasks(loop) if task.cancelling() or task.cancel()]
        if left:  # those that were cancelled before are cleaning up
            loop.run_until_complete(asyncio.wait(left, timeout=STOP_SECONDS))
        loop.run_until_complete(loop.shutdown_asyncgens())
    finally:
        loop.close()


def _make_body(path: Path, kind: str) -> Any:  # noqa: ANN401 - of a user's class
    """Create an object of a class in a file, or raise UserError if it cannot serve as a robot."""
    module = load_skill_module(path)
    members = vars(module).items()
    classes = [n for n, one in members if inspect.isclass(one) and one.__module__ == module.__name__]
    if kind not in classes:
        hint = f"; its classes are {listed(classes)}" if classes else "; add it"
        raise UserError(f"the file has no class {kind}{hint}", file=path)
    body = getattr(module, kind)
    line = inspect.getsourcelines(body)[1]
    for method, why in REQUIRED_METHODS.items():
        if not callable(getattr(body, method, None)):
            sentence = f"{kind} has no method {method}, {why}; add def {method}(self)"
            raise UserError(sentence, file=path, line=line)
    try:
        return body()
    except Exception as error:
        raise UserError(f"{kind}() failed: {_describe(error)}", file=path, line=line) from error


OWN_CODE = str(Path(__file__).parents[1])
REQUIRED_METHODS = {"stop": "which stops the robot at once", "rooms": "which lists the rooms"}


def _describe(error: Exception) -> str:
    """Describe an error with its type, its message, and the last line of the user's code in its traceback."""
    own = [frame for frame in extract_tb(error.__traceback__) if not frame.filename.startswith(OWN_CODE)]
    where = f" ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own else ""
    return f"{type(error).__name__}: {error}{where}"
