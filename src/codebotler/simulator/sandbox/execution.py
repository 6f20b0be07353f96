"""Runs a program inside its process, with fuel, a simulated clock and skills as functions."""

from __future__ import annotations

import builtins
import itertools
import sys
import types
from _json import encode_basestring_ascii as quoted
from marshal import loads
from sys import _getframe as getframe
from sys import setrecursionlimit

from codebotler.simulator.sandbox import BY_NAME, CAUGHT, ENTER, ENTRY, FUEL, PROGRAM
from codebotler.simulator.sandbox.channel import receive, send

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any, TypeAlias

    ParameterDescription: TypeAlias = tuple[str, str, tuple[Any, ...], str]  # name, kind, choices, words
    SkillDescriptions: TypeAlias = tuple[tuple[str, tuple[ParameterDescription, ...]], ...]
    # The fuel, the time now, the limit of time, the start of the clocks, and whether the run is live.
    RunParameters: TypeAlias = tuple[int, float, float, float, bool]

# This module's own copy of the builtins, which a program cannot change.
__builtins__ = dict(vars(builtins))  # type: ignore[assignment]  # Python also accepts a dict

# Python 3.11 also counts calls into C, so two more calls allow the same recursion as in Python 3.12.
PROGRAM_RECURSION_LIMIT = 1000 if sys.version_info >= (3, 12) else 1002
HEADROOM = 50  # calls that a skill may add, so that only the program can hit the limit

COROUTINE = 0x80  # the flag of coroutines in `co_flags`
UNAWAITED = "task_program is a coroutine, which nobody awaits; write def, not async def"


class ProgramRun:
    """Runs one program in a child process. It is created before the fork, so that children start fast."""

    recursion_limit = PROGRAM_RECURSION_LIMIT

    def __init__(self) -> None:
        self.skills: SkillDescriptions = ()
        self.kinds: dict[str, list[str]] = {}  # parameter kinds of each skill; `list` means options
        self.now = 0.0
        self.has_reached_limit = self.entered = False
        self.refused_at: int | None = None  # the line where a rule ended the run
        self.codes: set[types.CodeType] = set()
        self.fuel = 0
        self.start = self.seconds = 0.0
        self.is_live = False  # whether time is real
        self.namespace = types.ModuleType("__main__")
        vars(builtins).update(self.counters())

    def provide(self, skills: SkillDescriptions) -> None:
        """Provide the names that a program has without an import: the skills, `sys` and `time`."""
        names = vars(self.namespace)
        for name, _ in self.skills:
            del names[name]
        self.skills = skills
        names.update((name, self.skill(name, parameters)) for name, parameters in skills)
        names.update(sys=sys, time=sys.modules["time"], __builtins__=builtins)

    def execute(self, code: bytes | types.CodeType, parameters: RunParameters) -> str:
        """Run the program with these limits and clocks, and return how it ended as JSON."""
        self.fuel, self.now, self.seconds, self.start, self.is_live = parameters
        names = vars(self.namespace)
        sys.modules["__main__"] = self.namespace
        try:
            exec(loads(code) if type(code) is bytes else code, names)  # noqa: S102, S302 - the purpose of the sandbox
            task = names.get("task_program")
            if not self.has_entered(task):
                eval(call_task.__code__, names)  # noqa: S307 - the purpose of the sandbox
            if self.is_unawaited(task):
                raise TypeError(UNAWAITED)  # noqa: TRY301 - another function would use up recursion depth
        except BaseException as error:  # noqa: BLE001 - any end of a program is an outcome
            setrecursionlimit(self.recursion_limit + HEADROOM)
            return self.ended_by(error)
        return self.ended_by(LimitReachedError()) if self.has_reached_limit else '{"end":"finished"}'

    def ended_by(self, error: BaseException) -> str:
        """Return as JSON how the program ended, given the error that ended it."""
        kind, line = type(error), self.refused_at or _last_line(error)
        message = str.__getitem__(_message_of(error), slice(1000))  # a subclass of `str` may use fuel
        where = f'"line":{"null" if line is None else line}'
        if self.has_reached_limit or issubclass(kind, LimitReachedError):
            return f'{{"end":"timeout",{where}}}'
        if issubclass(kind, SystemExit):
            code = _own(SystemExit, "code", error)
            if code is None or (type(code) is int and code == 0):
                return '{"end":"finished"}'
        if issubclass(kind, SkillError):
            number = _number_of(error)
            if number is not None:
                return f'{{"end":"robot-error","number":{number},"now":{self.now!r},{where}}}'
        if issubclass(kind, SyntaxError) and line is None:
            lineno = _own(SyntaxError, "lineno", error)
            where = f'"line":{lineno if type(lineno) is int else "null"}'
        name = str.__getitem__(NAME_OF(kind), slice(100))
        where += f',"now":{self.now!r}'
        return f'{{"end":"python-error","kind":{quoted(name)},"message":{quoted(message)},{where}}}'

    def counters(self) -> dict[str, Callable[[], None]]:
        """Return the functions that compiled programs call to use fuel and to record calls, by name."""
        use_fuel = self.fuel_counter()
        return {
            FUEL: use_fuel,
            CAUGHT: self.except_hook(use_fuel),
            # Goes one call deeper than a skill before lifting the recursion limit, and so hits it first.
            ENTRY: lambda: use_fuel(),  # noqa: PLW0108 - see above
            ENTER: self.enter,
            BY_NAME: self.start_task,
        }

    def enter(self) -> None:
        """Record that the program has entered one of the functions that it defines at its top level."""
        code = getframe(1).f_code
        self.codes.add(code)
        self.entered = self.entered or code.co_name == "task_program"

    def start_task(self) -> None:
        """Record that the program calls `task_program` by this name."""
        self.entered = True

    def has_entered(self, task: object) -> bool:
        """Return whether the program has called its function `task`, the task program, under any name."""
        return self.entered or (type(task) is types.FunctionType and task.__code__ in self.codes)

    def is_unawaited(self, task: object) -> bool:
        """Return whether the function `task` is an `async def` that never started to run."""
        return (
            type(task) is types.FunctionType
            and task.__code__.co_flags & COROUTINE != 0
            and task.__code__ not in self.codes
        )

    def fuel_counter(self) -> Callable[[], None]:
        """Return a function that uses one unit of fuel, or raises LimitReachedError if none is left."""
        self.refuel()

        def use_fuel() -> None:
            if self.count() > self.fuel or self.has_reached_limit:
                self.has_reached_limit = True
                raise LimitReachedError

        return use_fuel

    def except_hook(self, use_fuel: Callable[[], None]) -> Callable[[], None]:
        """Return the function that each `except` and `finally` calls first. It uses fuel."""
        return use_fuel

    def refuel(self) -> None:
        """Give the program its full fuel again."""
        self.count = itertools.count(1).__next__

    def skill(self, name: str, parameters: tuple[ParameterDescription, ...]) -> object:
        """Return the function that a program calls to execute a skill."""
        names = ", ".join(parameter[0] for parameter in parameters)
        arguments = "".join(f"{parameter[0]}, " for parameter in parameters)
        types_: list[tuple[type | str, ParameterDescription]] = [
            (each[1] if each[2] else EXACT_TYPES.get(each[1], each[1]), each) for each in parameters
        ]
        self.kinds[name] = [kind for _, kind, _, _ in parameters]
        scope = {"perform": lambda *values: self.perform(name, types_, values), "limit": setrecursionlimit}
        exec(  # noqa: S102 - made from trusted text
            f"def {name}({names}):\n"
            f"    limit({self.recursion_limit + HEADROOM})\n"
            f"    try: return perform({arguments})\n"
            f"    finally: limit({self.recursion_limit})\n",
            scope,
        )
        return scope[name]

    def perform(
        self, name: str, parameters: list[tuple[type | str, ParameterDescription]], values: tuple[Any, ...]
    ) -> Any:  # noqa: ANN401 - a skill may return any type
        """Execute a skill. Raise TypeError or ValueError for wrong arguments, and for subclasses of `str`."""
        for (kind, parameter), value in zip(parameters, values, strict=True):
            given: type = type(value)
            if given is not kind:
                _check_fit(name, parameter, value, given)
        if self.has_reached_limit:
            raise LimitReachedError
        arguments = [value.copy() if type(value) is list else value for value in values]
        result = self.carry_out(name, arguments)
        if type(result) is int:
            for (kind, _), options in zip(parameters, arguments, strict=True):
                if kind is list and options:
                    return options[result]  # the same object that the program passed
        return result

    def carry_out(self, name: str, arguments: list[Any]) -> Any:  # noqa: ANN401 - a skill may return any type
        """Ask the engine to execute a skill, and return its result."""
        pairs = zip(self.kinds[name], arguments, strict=True)
        given = [JSON_WRITERS.get(kind, _value_text)(value) for kind, value in pairs]
        return self.request(f"{quoted(name)},[{','.join(given)}]")

    def sleep(self, seconds: object, /) -> None:
        """Let `seconds` pass: on the simulated clock, or for a live robot on the real one."""
        if not isinstance(seconds, int | float):
            raise TypeError(f"{NAME_OF(type(seconds))!r} object cannot be interpreted as an integer")
        if not 0 <= seconds < float("inf"):
            raise ValueError("sleep length must be non-negative and finite")
        if self.is_live:
            self.request(f'"sleep",[{float(seconds)!r}]')
            return
        self.now += seconds
        if self.now > self.seconds:
            self.request('"sleep",[]')

    def wait_for_ever(self) -> None:
        """End the run, since a wait without a timeout would never end in a program with one thread."""
        self.request('"wait",[]')

    def request(self, request: str) -> Any:  # noqa: ANN401 - a skill may return any type
        """Send a request (JSON for name and arguments). Return the value of the reply, or raise its error."""
        if self.has_reached_limit:
            raise LimitReachedError
        where = f",{_line_at_work()}" if self.is_live else ""
        send(f"[{request},{self.now!r}{where}]")
        kind, value, self.now = receive()
        if self.is_live:
            self.refuel()
        if kind == "ok":
            return value
        if kind == "error":
            raise robot_error(*value)
        self.has_reached_limit = True
        self.refused_at = (_line_at_work() or None) if value else None
        raise LimitReachedError


def call_task() -> object:
    """Call `task_program`. This function's code object is run with the program's global names."""
    return task_program()  # type: ignore[name-defined] # noqa: F821 - defined by the program


def _options_text(options: list[Any]) -> str:
    """Encode options as JSON: for each, its text and whether it is a `str`."""
    texts = [(str(option), issubclass(type(option), str)) for option in options]
    parts = [f"[{quoted(text)},{'true' if is_text else 'false'}]" for text, is_text in texts]
    return f"[{','.join(parts)}]"


def _check_fit(name: str, parameter: ParameterDescription, value: Any, given: type) -> None:  # noqa: ANN401 - any value of the program
    named, kind, choices, words = parameter
    base = kind[5:-1] if kind[:5] == "list[" else ""
    if base and given is list:
        for each in list.__iter__(value):
            _check_fit(name, (named, base, choices, words), each, type(each))
        return
    if not (given is PARAMETER_TYPES.get(kind) or (kind == "float" and given is int)):
        raise TypeError(f"{name}: {named} must be {words}, not {NAME_OF(given)}")
    if choices and value not in choices:
        raise ValueError(f"{name}: {named} must be {words}, not {repr(value)[:100]}")
    is_large = given is int and not -MAX_EXACT_INT <= value <= MAX_EXACT_INT
    if is_large or (given is float and value - value != 0):
        raise ValueError(f"{name}: {named} must be a number between -2**53 and 2**53")


def _value_text(value: Any) -> str:  # noqa: ANN401 - a scalar or a list of them
    if type(value) is list:
        return f"[{','.join([_value_text(each) for each in value])}]"
    if type(value) is str:
        return quoted(value)
    return {True: "true", False: "false"}[value] if type(value) is bool else repr(value)


def _line_at_work() -> int:
    """Return the program's line that called us, or 0 if there is none."""
    frame: types.FrameType | None = getframe(1)
    while frame is not None and frame.f_code.co_filename != PROGRAM:
        frame = frame.f_back
    return 0 if frame is None else frame.f_lineno or 0


def _last_line(error: BaseException) -> int | None:
    line, traceback = None, _own(BaseException, "__traceback__", error)
    while traceback is not None:
        if traceback.tb_frame.f_code.co_filename == PROGRAM:
            line = traceback.tb_lineno
        traceback = traceback.tb_next
    return line


def _own(kind: type[BaseException], name: str, error: BaseException) -> Any:  # noqa: ANN401 - of any type
    """Read an exception's attribute as its base class defines it, whatever the program overrides."""
    return kind.__dict__[name].__get__(error)


def _message_of(error: BaseException) -> str:
    try:
        return str(error)
    except BaseException:  # noqa: BLE001 - the program's own __str__ may raise anything
        return ""


EXACT_TYPES: dict[str, type] = {"str": str, "list": list}
PARAMETER_TYPES: dict[str, type] = {**EXACT_TYPES, "int": int, "float": float, "bool": bool}
JSON_WRITERS: dict[str, Callable[[Any], str]] = {"str": quoted, "list": _options_text}
MAX_EXACT_INT = 2**53  # JSON preserves integers up to this size
NAME_OF: Callable[[type], str] = type.__dict__["__name__"].__get__
"""Returns the name of a class, whatever the program's metaclass overrides."""


class LimitReachedError(BaseException):
    """The run has reached a limit. Each further loop iteration, call or skill raises this error again."""


class SkillError(Exception):
    """The robot could not execute a skill."""

    number = -1  # identifies the error to the engine; a class has the number of its latest error


SkillError.__name__ = SkillError.__qualname__ = "RobotError"  # the name that programs see
ROBOT_ERROR_CLASSES: dict[str, type[SkillError]] = {}


def robot_error(number: int, kind: str, text: str) -> SkillError:
    """Return the exception that the program gets for robot error `number`. Each `kind` has its own class."""
    if kind not in ROBOT_ERROR_CLASSES:
        ROBOT_ERROR_CLASSES[kind] = type(kind, (SkillError,), {"__module__": "robot"})
    ROBOT_ERROR_CLASSES[kind].number = number
    error = ROBOT_ERROR_CLASSES[kind](text)
    error.number = number
    return error


def _number_of(error: BaseException) -> int | None:
    """Return the number of a robot error, or None if the program created the error itself."""
    try:
        number = error.number  # type: ignore[attr-defined]  # the program may override it
    except BaseException:  # noqa: BLE001 - see above
        return None
    return number if type(number) is int and number >= 0 else None
