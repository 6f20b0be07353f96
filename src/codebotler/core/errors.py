"""The one kind of error that a user can cause, and YAML read so that every error names its line."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

Place: TypeAlias = tuple[str | int, ...]
Model = TypeVar("Model", bound=BaseModel)

Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
MAX_BYTES = 5_000_000
MAX_DEPTH = 50
MAX_PLACES = 100_000
MAX_NUMBER = 2**63
MAX_DIGITS = 1_000  # of what Python may refuse to read as a number at all
MAX_SENTENCE = 600
MENDS = {
    "mapping values are not allowed in this context": 'put quotes around a text that holds ": "',
    "found character that cannot start any token": "put quotes around a text, and indent with spaces",
}
TAGS = {
    "map": "a mapping",
    "seq": "a list",
    "str": "a text",
    "int": "a whole number",
    "float": "a number",
    "bool": "true or false",
    "null": "nothing",
    "timestamp": "a date",
}
TAG = "tag:yaml.org,2002:"
UNPRINTABLE = re.compile(
    r"[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
)  # what YAML 1.1 keeps out of files


class UserError(ValueError):
    """Something a user gave cannot be used; its text is one sentence that says where and how to mend it.

    Args:
        sentence: what is wrong and, where it helps, the mend; put on one line, and a very long one shortened.
        file: the file it stands in.
        line: the line, counted from 1.
    """

    def __init__(self, sentence: str, *, file: Path | str | None = None, line: int | None = None) -> None:
        self.sentence, self.file, self.line = _brief(" ".join(sentence.splitlines())), file, line
        where = "" if file is None else f"{file}: " if line is None else f"{file}, line {line}: "
        super().__init__(where + self.sentence)

    def __reduce__(self) -> tuple[object, ...]:
        return partial(type(self), file=self.file, line=self.line), (self.sentence,), vars(self)


BadInput = UserError  # the former name, for one version


def _brief(text: str, most: int = MAX_SENTENCE) -> str:
    half = most // 2
    return text if len(text) <= most else f"{text[:half]} ... {text[-half:]}"


class _Bounded(Loader):  # type: ignore[misc]  # one of two classes, chosen above
    """A loader that knows the line of what is nested too deeply for the C stack, or cannot be read."""

    depth = 0

    def descend_resolver(self, parent: yaml.Node | None, index: object) -> None:
        """Called where a node begins."""
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise _FaultError(TOO_DEEP, parent)
        super().descend_resolver(parent, index)

    def ascend_resolver(self) -> None:
        """Called where a node ends."""
        self.depth -= 1
        super().ascend_resolver()

    def construct_object(self, node: yaml.Node, deep: bool = False) -> object:  # noqa: FBT001, FBT002 - theirs
        """Called for every node, within the call for what holds it."""
        try:
            value = super().construct_object(node, deep)
        except (ValueError, ArithmeticError, LookupError, AttributeError):
            if node.tag == TAG + "int" and len(node.value) >= MAX_DIGITS:
                raise _FaultError(f"{_quoted(node)} {TOO_LARGE}", node) from None
            what = TAGS[node.tag.removeprefix(TAG)]
            fault = f"{_quoted(node)} is not {what}; correct it or put quotes around it"
            raise _FaultError(fault, node) from None
        if isinstance(value, int) and abs(value) >= MAX_NUMBER:
            raise _FaultError(f"{_quoted(node)} {TOO_LARGE}", node)
        return value


TOO_LARGE = "is too large a number; write a smaller one, or put quotes around a text"
TOO_DEEP = f"this is nested more than {MAX_DEPTH} deep, or within itself; write it flatter"


class _FaultError(Exception):
    """A fault of a node."""

    def __init__(self, sentence: str, node: yaml.Node | None) -> None:
        super().__init__(sentence)
        self.line = None if node is None else node.start_mark.line + 1


def _quoted(node: yaml.Node) -> str:
    return f'"{_brief(node.value, 40)}"' if isinstance(node, yaml.ScalarNode) else "this"


class YamlFile:
    """A parsed YAML file that remembers on which line everything stands.

    Args:
        text: the file's content.
        name: what error sentences call the file.

    Raises:
        UserError: it is no YAML, a key stands twice in one mapping, or its anchors make too much of it.
    """

    def __init__(self, text: str, name: Path | str) -> None:
        self.name = name
        self._last = max(1, len(text.splitlines()))
        self._lines: dict[Place, int] = {}
        if found := UNPRINTABLE.search(text):
            code = f"U+{ord(found[0]):04X}"
            raise UserError(
                f"the character {code} may not stand in YAML; remove it",
                file=name,
                line=text.count("\n", 0, found.start()) + 1,
            )
        try:
            loader = _Bounded(text)
            node = loader.get_single_node()
            if node is not None:
                self._remember(node, ())
            self.data: object = None if node is None else loader.construct_document(node)
        except yaml.YAMLError as error:
            raise self._syntax(error) from None
        except _FaultError as error:
            raise UserError(str(error), file=name, line=error.line) from None

    @classmethod
    def read(cls, path: Path) -> YamlFile:
        """Read and parse a file.

        Raises:
            UserError: it is missing, unreadable, too large, or no YAML.
        """
        return cls(read_text(path), path)

    def line(self, place: Sequence[str | int]) -> int | None:
        """The line of what stands at a path of keys and positions, or of the nearest thing around it."""
        path = tuple(place)
        while path not in self._lines:
            if not path:
                return None
            *around, last = path  # a number may be a key, which is kept as it is spelt
            path = (*around, str(last)) if isinstance(last, int) else tuple(around)
        return self._lines[path]

    def wrong(self, sentence: str, *place: str | int) -> UserError:
        """The error that says a sentence about what stands at a place."""
        return UserError(sentence, file=self.name, line=self.line(place))

    def validate(self, model: type[Model], data: object = None, *, at: Place = ()) -> Model:
        """This file's content (or a part of it) as a model.

        Args:
            model: what it must look like.
            data: the part; everything by default.
            at: where the part stands.

        Raises:
            UserError: it does not look like it; the sentence is about the first fault.
        """
        try:
            return model.model_validate(self.data if data is None and not at else data)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            place = (*at, *first["loc"])
            raise self.wrong(_sentence(first, self._name(place)), *place) from None

    def _name(self, place: Place) -> str:
        if not place:
            return "the file"
        if place[-1] == "[key]":
            return "this key"
        return f'"{place[-1]}"' if isinstance(place[-1], str) and place in self._lines else "this entry"

    def _syntax(self, error: yaml.YAMLError) -> UserError:
        mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        problem = getattr(error, "problem", None)
        said = [getattr(error, "context", None), problem or getattr(error, "reason", None)]
        sentence = ", ".join(part for part in said if part).replace(", but", " but") or "unreadable"
        if problem in MENDS:
            sentence += "; " + MENDS[problem]
        line = None if mark is None else min(mark.line + 1, self._last)  # it may stand behind the end
        return UserError(f"this is no valid YAML: {sentence}", file=self.name, line=line)

    def _remember(self, node: yaml.Node, place: Place) -> None:
        self._lines[place] = node.start_mark.line + 1
        if len(place) > MAX_DEPTH:
            raise _FaultError(TOO_DEEP, node)
        if len(self._lines) > MAX_PLACES:
            raise _FaultError(
                f"up to here there are {MAX_PLACES:,} entries, too many, or anchors repeat them", node
            )
        _check_tag(node)
        if isinstance(node, yaml.SequenceNode):
            for index, item in enumerate(node.value):
                self._remember(item, (*place, index))
        elif isinstance(node, yaml.MappingNode):
            for key, value in node.value:
                if not isinstance(key, yaml.ScalarNode):
                    raise _FaultError("this key is no text; write one word or put quotes around it", key)
                _check_tag(key)
                inner = (*place, str(key.value))
                if inner in self._lines:
                    raise _FaultError(
                        f'the key "{key.value}" stands here a second time; keep one of them', key
                    )
                self._remember(value, inner)
                self._lines[inner] = key.start_mark.line + 1


def _check_tag(node: yaml.Node) -> None:
    tag = node.tag.removeprefix(TAG)
    if tag == "merge":
        raise _FaultError('merging with "<<" is not supported; write the keys out', node)
    if tag == "value":
        raise _FaultError('"=" alone is no text; put quotes around it', node)
    if tag not in TAGS:
        raise _FaultError(f'the tag "{tag}" is not supported; remove it', node)


def read_text(path: Path, *, limit: int = MAX_BYTES) -> str:
    """Read a text file of reasonable size.

    Args:
        path: the file.
        limit: the largest size in bytes.

    Raises:
        UserError: it is missing, a folder, unreadable, larger than the limit, or no UTF-8.
    """
    try:
        with path.open("rb") as file:
            data = file.read(limit + 1)
    except FileNotFoundError:
        raise UserError("there is no such file", file=path) from None
    except IsADirectoryError:
        raise UserError("is a folder; name a file", file=path) from None
    except OSError as error:
        raise UserError(f"cannot be read ({error.strerror})", file=path) from None
    return text_of(data, path, limit=limit)


def text_of(data: bytes, name: Path | str, *, limit: int = MAX_BYTES) -> str:
    """The text that a file's bytes are, with the line ends of any system and without a byte order mark.

    Args:
        data: the bytes; of a larger file one more than the limit is enough.
        name: what error sentences call the file.
        limit: the largest size in bytes.

    Raises:
        UserError: it is larger than the limit, or no UTF-8.
    """
    if len(data) > limit:
        raise UserError(f"is larger than {limit:,} bytes", file=name)
    try:
        return io.StringIO(data.decode("utf-8-sig"), newline=None).read()
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise UserError("is no UTF-8 text; save it as UTF-8", file=name, line=line) from None


EXPECTED = {
    "string_type": "a text",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "a mapping of keys to values",
    "model_type": "a mapping of keys to values",
    "float_type": "a number",
    "int_type": "a whole number",
    "bool_type": "true or false",
}
FAULTS = {
    "extra_forbidden": "the key {name} means nothing here; remove it or correct its spelling",
    "invalid_key": "this key is no text; remove it or put quotes around it",
    "string_too_short": "{name} is empty; write a text",
    "too_short": "{name} has too few entries; it needs at least {min_length}",
    "too_long": "{name} has too many entries; it takes {max_length}",
    "finite_number": "{name} is no finite number",
}
WHAT = (
    (bool, "a truth value"),
    (int | float, "a number"),
    (str, "a text"),
    (date, "a date"),
    (Mapping, "a mapping"),
    (list, "a list"),
    (object, "something else"),
)


def _sentence(error: ErrorDetails, name: str) -> str:
    kind, value = error["type"], error["input"]
    if kind == "missing":
        last = error["loc"][-1]
        if isinstance(last, str):
            return f'the key "{last}" is missing'
        return f"this entry has too few values; it needs at least {last + 1}"
    if kind in EXPECTED:
        return f"{name} {_instead_of(EXPECTED[kind], value)}"
    if kind in FAULTS:
        return FAULTS[kind].format(name=name, **error.get("ctx", {}))
    plain = error["msg"].removeprefix("Value error, ").replace("Input should be", "it should be")
    plain = plain[:1].lower() + plain[1:]
    if isinstance(value, Mapping | Sequence) and not isinstance(value, str):
        return f"{name} is not as it should be: {plain}"
    return f"{name} is {value if isinstance(value, date) else repr(value)}, but {plain}"


def _instead_of(expected: str, value: object) -> str:
    if value is None:
        return "is empty; fill it in or remove it"
    sentence = f"is {next(word for kind, word in WHAT if isinstance(value, kind))}, not {expected}"
    if expected != "a text" or not isinstance(value, int | float | date):
        return sentence
    word = {True: ' ("yes")', False: ' ("no")'}[value] if isinstance(value, bool) else ""
    return f"{sentence}; put quotes around it{word}"
