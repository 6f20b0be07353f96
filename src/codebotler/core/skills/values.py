"""The types of arguments and results of skills, and how programs write their values."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from math import isfinite
from typing import Any, Literal, NewType, TypeAlias, get_args, get_origin

from codebotler.core.text.words import listed

Scalar: TypeAlias = str | int | float | bool
Base: TypeAlias = Literal["str", "int", "float", "bool"]

RoomName = NewType("RoomName", str)
"""The annotation `-> RoomName` for a skill that returns the name of a room."""

ThingName = NewType("ThingName", str)
"""The annotation `-> ThingName` for a skill that returns the name of a thing."""

PersonName = NewType("PersonName", str)
"""The annotation `-> PersonName` for a skill that returns the name of a person."""

MAX_INTEGER = 2**53  # JSON and robots represent integers up to this value exactly
BASE_TYPES: Mapping[type, Base] = {str: "str", int: "int", float: "float", bool: "bool"}


@dataclass(frozen=True)
class ValueType:
    """The type of an argument or a result of a skill.

    Args:
        base: the type of a single value; None for no value.
        is_list: whether the value is a list of `base` values.
        choices: the allowed values; empty if every value of the type is allowed.
        enum: the enumeration whose members the skill's function receives instead of plain choices.
        names: what a string names; empty for any text.
    """

    base: Base | None = "str"
    is_list: bool = False
    choices: tuple[Scalar, ...] = ()
    enum: type[Enum] | None = field(default=None, compare=False)
    names: Literal["", "room", "thing", "person"] = field(default="", compare=False)

    @property
    def kind(self) -> str:
        """The name of the type in the sandbox, such as `str` or `list[int]`, without choices."""
        return f"list[{self.base}]" if self.is_list else str(self.base)

    @property
    def annotation(self) -> str:
        """The annotation that models see, such as `list[str]` or `Literal["red", "green"]`."""
        quoted = map(_written, self.choices)
        one = f"Literal[{', '.join(quoted)}]" if self.choices else str(self.base)
        return f"list[{one}]" if self.is_list else one

    @property
    def in_words(self) -> str:
        """The expected values in words, such as `a whole number` or `"red" or "green"`."""
        if self.base is None:
            return "nothing"
        quoted = [f'"{one}"' if isinstance(one, str) else str(one) for one in self.choices]
        one, many = [listed(quoted, "or")] * 2 if quoted else TYPE_NAMES[self.base]
        return f"a list of {many}" if self.is_list else one

    def fits(self, value: object) -> bool:
        """Whether a value has this type and is among the choices, if any. An integer also fits `float`."""
        if self.base is None:
            return value is None
        if self.is_list:
            return isinstance(value, list | tuple) and all(map(self._fits_one, value))
        return self._fits_one(value)

    def _fits_one(self, value: object) -> bool:
        given = type(value)
        if given.__name__ != self.base and not (self.base == "float" and given is int):
            return False
        if isinstance(value, float) and not isfinite(value):
            return False
        if given is int and abs(value) > MAX_INTEGER:  # type: ignore[arg-type]  # a whole number
            return False
        return not self.choices or value in self.choices

    def convert(self, value: Any) -> Any:  # noqa: ANN401 - any of these types
        """Convert an argument for the skill's function: `"red"` to `Color.RED` for an Enum, or 3 to 3.0."""
        if isinstance(value, list | tuple):
            return [self.convert(each) for each in value]
        if self.enum is not None:
            return self.enum(value)
        return float(value) if self.base == "float" else value


TYPE_NAMES: Mapping[Base, Sequence[str]] = {
    "str": ("text", "texts"),
    "int": ("a whole number", "whole numbers"),
    "float": ("a number", "numbers"),
    "bool": ("True or False", "truth values"),
}
SINGLE_TYPES: Mapping[object, ValueType] = {
    **{one: ValueType(base) for one, base in BASE_TYPES.items()},
    RoomName: ValueType(names="room"),
    ThingName: ValueType(names="thing"),
    PersonName: ValueType(names="person"),
}
TEXT_TYPE, TRUTH_TYPE, NO_VALUE = ValueType(), ValueType("bool"), ValueType(None)


def plain(value: Any) -> Any:  # noqa: ANN401 - any of these types
    """Replace members of enumerations with their values, such as `Color.RED` with `"red"`, even in lists."""
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    return value.value if isinstance(value, Enum) else value


def value_type(annotation: object) -> ValueType | None:
    """Return the type for an annotation such as `list[str]`, or None if skills cannot use it."""
    if annotation is None or annotation is type(None):
        return NO_VALUE
    if isinstance(annotation, type | NewType) and annotation in SINGLE_TYPES:
        return SINGLE_TYPES[annotation]
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        return _one_of(tuple(member.value for member in annotation), annotation)
    if get_origin(annotation) is Literal:
        return _one_of(get_args(annotation))
    if get_origin(annotation) is list and len(get_args(annotation)) == 1:
        inner = value_type(get_args(annotation)[0])
        if inner is not None and inner.base is not None and not inner.is_list:
            return replace(inner, is_list=True)
    return None


def _one_of(choices: tuple[Any, ...], enum: type[Enum] | None = None) -> ValueType | None:
    kinds = {type(choice) for choice in choices}
    if len(kinds) != 1 or not kinds <= {str, int, float}:
        return None
    return ValueType(BASE_TYPES[kinds.pop()], choices=choices, enum=enum)


def sample_values(value: ValueType, names: Sequence[str] = ()) -> tuple[Any, ...]:
    """Return a few sample values of a type, such as True and False. Strings come from `names`, if given."""
    if value.is_list:
        some = sample_values(replace(value, is_list=False), names)
        return [some[0]], [], [some[0], some[-1]]
    if value.base is None:
        return (None,)
    return value.choices or tuple(names) or SCALAR_SAMPLES[value.base]


SCALAR_SAMPLES: Mapping[Base, tuple[Scalar, ...]] = {
    "bool": (True, False),
    "int": (1, 0, 2, 10),
    "float": (1.0, 0.0, 0.5, 100.0),
    "str": ("something", "another thing", "something else"),
}


def written_call(name: str, arguments: Sequence[object]) -> str:
    """Return the Python source of a call, such as `open_door("glass door")`."""
    return f"{name}({', '.join(map(_written, arguments))})"


def _written(value: object) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_written, value))}]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)


def as_text(value: object) -> str:
    """Convert an argument to text for events and rules: `3`, `0.5`, `red`, `true`, `cup, plate`."""
    if isinstance(value, list | tuple):
        return ", ".join(map(as_text, value))
    if isinstance(value, float) and value.is_integer():
        return f"{value:.0f}" if value else "0"  # without the sign of -0.0
    return str(value).lower() if isinstance(value, bool) else str(value)
