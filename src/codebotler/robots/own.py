"""A robot that is a class in a file of the user's: its methods are named as the skills, async or not."""

from __future__ import annotations

import asyncio
import inspect
import threading
from collections.abc import Callable, Coroutine, Mapping, Sequence
from concurrent.futures import CancelledError as FutureCancelledError
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from traceback import extract_tb
from typing import Any

from codebotler.core.errors import RobotError, UserError
from codebotler.core.skills.files import loaded
from codebotler.core.skills.table import Skill
from codebotler.core.skills.values import plain
from codebotler.core.words import listed
from codebotler.robots.base import (
    Argument,
    CancelledError,
    Feedback,
    NotReadyError,
    Options,
    Result,
    RobotLostError,
    no_feedback,
)
from codebotler.robots.clock import Clock

STOPS = 5.0  # seconds that an async `stop` may take
BY_HAND = "STOP THE ROBOT BY HAND"


def is_own(name: str) -> bool:
    """Whether the name of a robot is that of a class in a file, such as `lab_robot.py:Spot`."""
    return ".py:" in name


class OwnRobot:
    """Makes a robot of an object whose methods are named as the skills.

    `rooms()` lists the rooms, and `stop()`, which may be called from any thread while another method runs,
    stops the robot at once; what runs then may return or raise anything. A method raises RobotError, or an
    exception whose class is named as an error that the skill declares. Whatever else it raises ends the
    mission.

    Args:
        name: by which the user named it: the file and the class.
        options: a user's.

    Attributes:
        failed_stop: why it could not be stopped; empty if it could.

    Raises:
        UserError: there is no such file or class, or it lacks what every robot needs.
    """

    if_tool_dies = "nothing stops the robot unless its class sees to that"
    rooms_are_regexes = has_pose = False

    def __init__(self, name: str, options: Options) -> None:
        path, _, kind = name.rpartition(":")
        self.name, self.address, self.skills = kind, f"{Path(path).resolve()}:{kind}", options.skills
        self.clock = Clock(1.0)
        self._body = _made(Path(path), kind)
        methods = {skill: self._method(skill) for skill in self.skills}
        self._methods = {skill: method for skill, method in methods.items() if method is not None}
        for skill, method in self._methods.items():
            _expect_fit(kind, method, self.skills[skill])
        self.missing: Mapping[str, str] = {
            skill: f"{kind} has no method {skill}" for skill in self.skills if skill not in self._methods
        }
        self._stopped = True
        self._is_busy = False
        self._order, self._told = threading.Lock(), threading.Event()
        self._told.set()  # there is nothing to tell
        self.failed_stop = ""
        self._loop: asyncio.AbstractEventLoop | None = None
        self._running: Future[Any] | None = None

    def _method(self, skill: str) -> Callable[..., Any] | None:
        """What carries out a skill; `rooms()` lists the rooms if nothing else does."""
        try:
            method = getattr(self._body, skill, None)
        except Exception as error:
            raise UserError(f"{self.name}.{skill} is not a method: {_said(error)}") from error
        if method is None and skill == "get_all_rooms":
            method = self._body.rooms
        return method if callable(method) else None

    def connect(self) -> None:
        """Connect the robot, if its class has `connect`, and set the clock to 0."""
        if self._loop is None:
            self._loop = asyncio.new_event_loop()
            self._thread = threading.Thread(target=_run, args=(self._loop,), daemon=True)
            self._thread.start()
        self._stopped, self.failed_stop = False, ""
        connect = getattr(self._body, "connect", None)
        if connect is not None:
            try:
                self._finished(connect())
            except Exception as error:
                raise NotReadyError(f"{self.name} did not connect: {_said(error)}") from error
        self.clock.restart()

    def perform(self, skill: str, arguments: Sequence[Argument], _: Feedback = no_feedback) -> Result:
        """Call the method of a skill.

        Raises:
            RobotError: it says that the robot cannot do it.
            CancelledError: the robot was stopped.
            RobotLostError: it failed in another way, or the robot could not be stopped.
        """
        if self._stopped:
            raise CancelledError
        row = self.skills[skill]
        if skill not in self._methods:
            raise RobotError("SkillWithoutMethod", self.missing[skill])
        given = [parameter.type.wanted(one) for parameter, one in zip(row.parameters, arguments, strict=True)]
        self._is_busy = True
        try:
            result: Result = plain(self._finished(self._methods[skill](*given)))
        except Exception as error:
            self._expect_no_stop()
            kind = type(error).__name__
            if isinstance(error, RobotError):
                raise
            if kind in dict(row.fails):
                raise RobotError(kind, str(error) or f"{skill}: {dict(row.fails)[kind]}") from error
            self.cancel()
            failed = f"; {self.failed_stop}" if self.failed_stop else ""
            raise RobotLostError(f"{self.name}.{skill} failed: {_said(error)}{failed}") from error
        finally:
            self._is_busy = False
        self._expect_no_stop()
        return result

    def _expect_no_stop(self) -> None:
        """Raise what a stop makes of a skill, once it is known whether that has worked."""
        if not self._stopped:
            return
        if not self._told.wait(STOPS):
            raise RobotLostError(f"{self.name}.stop has not returned after {STOPS:.0f} s; {BY_HAND}")
        if self.failed_stop:
            raise RobotLostError(self.failed_stop)
        raise CancelledError

    def cancel(self) -> None:
        """Call `stop`, and cancel what is awaited."""
        with self._order:
            was_stopped, self._stopped = self._stopped, True
            if not was_stopped:
                self._told.clear()
        self.clock.stop()
        if was_stopped:
            self._told.wait(STOPS)  # by another call
            return
        try:
            self._finished(self._body.stop(), STOPS)
        except Exception as error:  # noqa: BLE001 - a stop raises nothing
            why = "it took too long" if isinstance(error, TimeoutError) else _said(error)
            self.failed_stop = f"{self.name}.stop failed: {why}; {BY_HAND}"
        finally:
            self._told.set()
        if (running := self._running) is not None:
            running.cancel()

    def disconnect(self) -> None:
        """End what goes on, call `disconnect` if the class has it, and end the loop of async methods."""
        if self._is_busy:
            self.cancel()
        self._stopped = True
        self.clock.stop()
        disconnect = getattr(self._body, "disconnect", None)
        if self._loop is None:
            return
        with suppress(Exception):  # it is left in any case
            if disconnect is not None:
                self._finished(disconnect(), STOPS)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._loop = None
        self._thread.join(STOPS)

    def _finished(self, result: Any, patience: float | None = None) -> Any:  # noqa: ANN401 - of a user's method
        """What a method has returned, or what comes of it if it is async."""
        if not inspect.iscoroutine(result):
            return result
        return self._awaited(result, patience)

    def _awaited(self, work: Coroutine[Any, Any, Any], patience: float | None) -> Any:  # noqa: ANN401 - the same
        assert self._loop is not None, "the robot is connected"
        future = asyncio.run_coroutine_threadsafe(work, self._loop)
        if patience is None:
            self._running = future
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
    """UserError if a method does not take what programs pass to its skill."""
    code = getattr(method, "__code__", None)
    try:
        inspect.signature(method).bind(*(parameter.name for parameter in skill.parameters))
    except TypeError:
        takes = ", ".join(["self", *(parameter.name for parameter in skill.parameters)])
        file, line = (None, None) if code is None else (code.co_filename, code.co_firstlineno)
        sentence = f"{kind}.{skill.name} does not take what programs pass; write def {skill.name}({takes})"
        raise UserError(sentence, file=file, line=line) from None
    except ValueError:  # it has no signature that Python knows
        return


def _run(loop: asyncio.AbstractEventLoop) -> None:
    """Run a loop until it is stopped."""
    try:
        loop.run_forever()
        loop.run_until_complete(loop.shutdown_asyncgens())
    finally:
        loop.close()


def _made(path: Path, kind: str) -> Any:  # noqa: ANN401 - of a user's class
    """An object of a class in a file; a UserError if it cannot be a robot."""
    module = loaded(path)
    classes = [
        n for n, one in vars(module).items() if inspect.isclass(one) and one.__module__ == module.__name__
    ]
    if kind not in classes:
        hint = f"; its classes are {listed(classes)}" if classes else ""
        raise UserError(f"it has no class {kind}{hint}", file=path)
    made = getattr(module, kind)
    line = inspect.getsourcelines(made)[1]
    for method, why in NEEDED.items():
        if not callable(getattr(made, method, None)):
            raise UserError(
                f"{kind} has no method {method}, {why}; add def {method}(self)", file=path, line=line
            )
    try:
        return made()
    except Exception as error:
        raise UserError(f"{kind}() failed: {_said(error)}", file=path, line=line) from error


OURS = str(Path(__file__).parents[1])
NEEDED = {"stop": "which stops the robot at once", "rooms": "which lists the rooms"}


def _said(error: Exception) -> str:
    """An error in words, with the last line of a file of the user's that it came through."""
    own = [frame for frame in extract_tb(error.__traceback__) if not frame.filename.startswith(OURS)]
    where = f" ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own else ""
    return f"{type(error).__name__}: {error}{where}"
