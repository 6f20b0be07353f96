"""Declare a skill as one typed function, whose signature and docstring are shown to models."""

from __future__ import annotations

import builtins
import functools
import re
from collections.abc import Callable, Mapping
from inspect import iscoroutinefunction, signature
from keyword import iskeyword
from math import inf
from types import FunctionType
from typing import Any, NoReturn, Unpack, overload

from codebotler.core.errors import VIOLATION, UserError
from codebotler.core.skills.kinds import INSIDE
from codebotler.core.skills.options import SkillOptions, wrong_options
from codebotler.core.skills.own_modules import is_own_module
from codebotler.core.skills.table import Parameter, Recording, RosAction, Skill, refuse
from codebotler.core.skills.values import NO_VALUE, TEXT_TYPE, ValueType, plain, value_type
from codebotler.core.skills.verbs import Verb, verb_of

RESERVED_NAMES = frozenset(
    {"task_program", "time", "sys", *dir(builtins), "stop", "rooms", "connect", "disconnect"}
)
POSE_IN_ROOM = Skill(
    "(pose)",
    (Parameter("room"),),
    NO_VALUE,
    "",
    Recording(INSIDE, "room", names="room"),
    verb=Verb("be inside", "is inside", "was inside", "being inside", "was in a room"),
)
"""A pseudo-skill whose event tells house rules that the robot's pose has entered a room."""
RTL_WORDS = frozenset(
    {
        *("at", "holding", "to", "found", "missed", "mention", "answered", "returned", "tr"),
        *("last_found", "last_missed"),
        *("words", "without", "number", "othernumber", "time", "othertime", "affirms", "denies", INSIDE),
    }
)
"""Words with a meaning in formulas, which cannot name events."""
_DECLARED: dict[str, Skill] = {}
PAPER_MODULE = "codebotler.core.skills.paper"
ROS_ACTION = re.compile(r"([^\W\d]\w*)/([A-Z]\w*):(/*[^/].*)")
ROS_TYPES = {"str": "string", "int": "int64", "float": "float64", "bool": "bool"}
USABLE = "str, int, float, bool, Literal, an Enum of texts or of numbers, or a list of one of these"


def by_name(name: str) -> Skill | None:
    """Return the skill with this name, or None if this process has not declared one."""
    return _DECLARED.get(name)


def all_names() -> list[str]:
    """Return the names of all skills that this process has declared."""
    return list(_DECLARED)


def by_event(kind: str) -> Skill | None:
    """Return the skill that records a kind of event, such as `go_to` for `goto`, or None if there is none."""
    other = POSE_IN_ROOM if kind == INSIDE else None
    return next((row for row in _DECLARED.values() if row.recording and row.recording.kind == kind), other)


@overload
def skill(does: Callable[..., Any], /) -> Skill: ...


@overload
def skill(**options: Unpack[SkillOptions]) -> Callable[[Callable[..., Any]], Skill]: ...


def skill(
    does: Callable[..., Any] | None = None, /, **options: Unpack[SkillOptions]
) -> Skill | Callable[[Callable[..., Any]], Skill]:
    """Declare a skill: put `@skill` above a function whose first parameter is the simulated robot.

    A function with an empty body (`...`) records the skill's event and returns a random value of its type. In
    some sampled worlds, it fails with one of the skill's errors.

    Args:
        does: the function, if `@skill` is used without options.
        options: see `SkillOptions`.

    Raises:
        UserError: the function cannot be a skill; the message gives the file and the line.
    """

    def declare(function: Callable[..., Any]) -> Skill:
        if not isinstance(function, FunctionType):
            raise UserError(f"@skill belongs above a function, not above {function!r:.80}")
        return _Declaration(function, options).skill()

    return declare if does is None else declare(does)


class _Declaration:
    """Builds a skill from a function and the options of its declaration."""

    def __init__(self, does: Callable[..., Any], options: SkillOptions) -> None:
        self.does, self.options = does, options
        self.name = does.__name__

    def skill(self) -> Skill:
        """Create the skill and register it by its name, or raise UserError if the declaration is wrong."""
        self.check_options()
        self.check_name()
        parameters, returns = self.parameters(), self.returns()
        recording = self.recording(parameters)
        fails = self.fails()
        doc = " ".join((self.does.__doc__ or "").split("\n\n")[0].split())
        if not doc:
            self.wrong(f"{self.name} has no docstring; add a sentence that says what the skill does")
        row = Skill(
            self.name,
            parameters,
            returns,
            doc,
            recording,
            self.ros(parameters, returns),
            self.verb(parameters, recording),
            self.options.get("seconds", 1.0),
            is_idle=self.options.get("is_idle", False),
            does=_drawn(self.does) if _is_empty(self.does) else self.does,
            adds_event=self.options.get("adds_event", True),
            fails=tuple(fails.items()),
            example=self.options.get("example", ""),
        )
        known = _DECLARED.get(self.name)
        if known is None or getattr(known.does, "__module__", "") != PAPER_MODULE:
            _DECLARED[self.name] = row
        return row

    def wrong(self, sentence: str) -> NoReturn:
        refuse(self.does, sentence)

    def check_options(self) -> None:
        if self.does.__module__ != PAPER_MODULE:
            for sentence in wrong_options(self.options):
                self.wrong(sentence)
        if not 0 <= self.options.get("seconds", 0.0) < inf:
            self.wrong(f"the option seconds is {self.options['seconds']}; write a number of at least 0")

    def check_name(self) -> None:
        is_second = isinstance(self.does.__globals__.get(self.name), Skill)
        if is_second and is_own_module(self.does.__module__):
            self.wrong(f"there is already a skill {self.name}; choose another name")
        if self.name in RESERVED_NAMES:
            self.wrong(f"{self.name} is a reserved name; choose another one")
        event = self.options.get("event") or self.name
        for word in (event, self.options.get("sets"), self.options.get("clears")):
            if word and (word in RTL_WORDS or iskeyword(word) or not word.isidentifier()):
                self.wrong(f'formulas cannot use "{word}" as a name; choose another event or state')

    def parameters(self) -> tuple[Parameter, ...]:
        if iscoroutinefunction(self.does):
            self.wrong(f"{self.name} is async, but skills must be ordinary functions; write def")
        taken = signature(self.does).parameters
        first, *names = taken or ("",)
        is_plain = all(p.kind is p.POSITIONAL_OR_KEYWORD and p.default is p.empty for p in taken.values())
        if not taken or not is_plain or value_type(self.annotation(first) or object) is not None:
            must = "must take the simulation first, then the arguments of programs without default values"
            self.wrong(f"{self.name} {must}; write parameters such as (sim: Simulation, door: str)")
        for name in names:
            if name not in self.does.__annotations__:
                mend = f"write {name}: str, or another type"
                self.wrong(f"the parameter {name} of {self.name} has no type; {mend}")
        types = [self.type_of(name, f"the type of the parameter {name}") for name in names]
        if NO_VALUE in types:
            self.wrong(f"a parameter of {self.name} cannot be None; use {USABLE}")
        asks = self.returns() == TEXT_TYPE  # a question lists its options, and returns one of them
        return tuple(
            Parameter(n, t, asks and n == "options" and t == ValueType(is_list=True))
            for n, t in zip(names, types, strict=True)
        )

    def returns(self) -> ValueType:
        if "return" not in self.does.__annotations__:
            self.wrong(f"{self.name} does not say what it returns; write -> None, or another type")
        return self.type_of("return", "the result")

    def type_of(self, name: str, what: str) -> ValueType:
        try:
            annotation = self.annotation(name)
        except Exception as error:  # noqa: BLE001 - evaluating it may raise anything
            self.wrong(f"{what} of {self.name} cannot be read: {error}")
        found = value_type(annotation)
        if found is None:
            written = getattr(annotation, "__name__", str(annotation))
            self.wrong(f"{what} of {self.name} is {written}, which skills cannot use; use {USABLE}")
        return found

    def annotation(self, name: str) -> object:
        """Return the annotation of a parameter or of `return`, evaluated if the file has it as a string."""
        annotation: object = self.does.__annotations__.get(name)
        if not isinstance(annotation, str):
            return annotation
        if name == self.does.__code__.co_varnames[0] and annotation not in vars(builtins):
            return object
        return eval(annotation, self.does.__globals__)  # noqa: S307 - of the user's own file

    def recording(self, parameters: tuple[Parameter, ...]) -> Recording | None:
        event = self.options.get("event", "")
        sets, clears = self.options.get("sets", ""), self.options.get("clears", "")
        if event is None:
            if sets or clears:
                self.wrong(f"{self.name} changes a state, so it needs an event; leave out event=None")
            return None
        to = self.options.get("to")
        options = next((each.name for each in parameters if each.is_options), None)
        names = [each.name for each in parameters if each.name != options]
        text = self.options.get("text") or next((name for name in names if name != to), "")
        for name in filter(None, (text, to)):
            if name not in names:
                self.wrong(f"{self.name} has no parameter {name}; correct the option text or to")
        if to and options is None:
            self.wrong("`to` is only for questions, which have a parameter options: list[str]; remove `to`")
        if (sets or clears) and (not text or options or sets == clears):
            self.wrong(f"{self.name} must set or clear a state of the thing in a parameter, but not both")
        more = tuple(name for name in names if name not in {text, to})
        tried = self.options.get("when_tried")
        is_judged = tried is True or (tried is None and (bool(sets) or not clears))
        named = self.options.get("names", "thing")
        kind = event or self.name
        return Recording(kind, text, options, to, named, tried is True, is_judged, more, sets, clears)

    def fails(self) -> Mapping[str, str]:
        fails = self.options.get("fails", {})
        for kind in fails:
            if not kind.isidentifier() or iskeyword(kind) or kind == VIOLATION or hasattr(builtins, kind):
                mend = 'choose another name, such as "DoorLocked"'
                self.wrong(f'"{kind}" cannot name an error of {self.name}; {mend}')
        return fails

    def verb(self, parameters: tuple[Parameter, ...], recording: Recording | None) -> Verb | None:
        verb = self.options.get("verb")
        if not isinstance(verb, str):
            return verb
        try:
            names = [each.name for each in parameters]
            if recording is not None:  # in the order of the event
                names = [name for name in (recording.text, *recording.more) if name]
            results = self.options.get("results", ("no", "yes"))
            return verb_of(verb, names, results, self.options.get("past", ""))
        except ValueError as error:
            self.wrong(f"{error}")

    def ros(self, parameters: tuple[Parameter, ...], returns: ValueType) -> RosAction | None:
        ros = self.options.get("ros")
        if ros is None or isinstance(ros, RosAction):
            return ros
        written = ROS_ACTION.fullmatch(ros)
        if written is None:
            mend = "write package/Type:/topic, as in lab_msgs/OpenDoor:/open_door"
            self.wrong(f'"{ros}" is not a ROS action; {mend}')
        unusable = [each.name for each in parameters if not re.fullmatch(r"[a-z][a-z0-9_]*", each.name)]
        if unusable:
            self.wrong(f"the parameter {unusable[0]} of {self.name} cannot be a ROS field; use a-z, 0-9, _")
        package, kind, server = written.groups()
        goal = tuple(f"{_ros_type(each.type)} {each.name}" for each in parameters)
        result = None if returns.base is None else _ros_type(returns)
        return RosAction(kind, server, goal, result, package=package)


def _ros_type(value: ValueType) -> str:
    return ROS_TYPES[value.base or "str"] + "[]" * value.is_list


def _is_empty(does: Callable[..., Any]) -> bool:
    code = does.__code__
    return code.co_code == _empty.__code__.co_code and {*code.co_consts} <= {does.__doc__, None, ...}


def _empty(_sim: object) -> None:
    """Do nothing."""


def _drawn(does: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(does)
    def drawn(sim: Any, *arguments: Any) -> Any:  # noqa: ANN401 - as any skill
        return sim.outcome(does.__name__, plain(arguments))

    return drawn
