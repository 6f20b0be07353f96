"""Read YAML with line numbers for error messages."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from copy import copy
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from codebotler.core.errors import UserError, elide_middle
from codebotler.core.files import read_text
from codebotler.core.text.unicode import compose

YamlPath: TypeAlias = tuple[str | int, ...]
"""The keys and positions that lead to a part of a file, such as `("rooms", 0, "name")`."""

FileModel = TypeVar("FileModel", bound=BaseModel)

Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
MAX_DEPTH = 50
MAX_PLACES = 100_000
MAX_NUMBER_LENGTH = 1_000  # characters; PyYAML takes quadratic time for numbers such as 1:59:59
MAX_QUOTED_VALUE = 80  # characters of a value in a message
TEXT_TAG = "tag:yaml.org,2002:str"
SMALL_NUMBER = re.compile(r"\d{1,4}", re.ASCII)
SYNTAX_MENDS = {
    "mapping values are not allowed in this context": 'put quotes around text that contains ": "',
    "found character that cannot start any token": "put quotes around text, and indent with spaces",
}


class _BoundedLoader(Loader):  # type: ignore[misc]  # one of two classes, chosen above
    """A loader that stops before the nesting overflows the C stack."""

    yaml_implicit_resolvers = {  # noqa: RUF012 - as in the base class, except that "<<" and "=" are texts
        first: forms for first, forms in Loader.yaml_implicit_resolvers.items() if first not in {"<", "="}
    }
    depth = 0

    def descend_resolver(self, parent: yaml.Node | None, index: object) -> None:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise _fault(f"the text is nested more than {MAX_DEPTH} levels deep; simplify the file", parent)
        super().descend_resolver(parent, index)

    def ascend_resolver(self) -> None:
        self.depth -= 1
        super().ascend_resolver()

    def construct_object(self, node: yaml.Node, deep: bool = False) -> object:  # noqa: FBT001, FBT002 - theirs
        is_long = (
            isinstance(node, yaml.ScalarNode) and node.tag != TEXT_TAG and len(node.value) > MAX_NUMBER_LENGTH
        )
        with suppress(ValueError, LookupError, AttributeError, OverflowError):  # such as an impossible date
            if not is_long:
                made = super().construct_object(node, deep)
                return compose(made) if isinstance(made, str) else made  # lists are filled later
        problem = f"{_quoted(node.value)} is not a valid {node.tag.rpartition(':')[2]}"
        raise _fault(f"{problem}; put quotes around the text", node)


def _fault(problem: str, node: yaml.Node | None) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=None if node is None else node.start_mark)


def _quoted(value: object) -> str:
    return elide_middle(f'"{value}"' if isinstance(value, str) else str(value), MAX_QUOTED_VALUE)


class YamlFile:
    """A parsed YAML file that knows the line of each part. Invalid YAML raises a UserError about `name`."""

    def __init__(self, text: str, name: Path | str) -> None:
        self.name = name
        self._text = text
        self._lines: dict[YamlPath, int] = {}
        try:
            loader = _BoundedLoader(text)
            node = loader.get_single_node()
            if node is not None:
                self._remember(node, ())
            self.data: object = None if node is None else loader.construct_document(node)
        except yaml.YAMLError as error:
            raise self._syntax_error(error) from None

    @classmethod
    def read(cls, path: Path) -> YamlFile:
        """Read and parse a file, or raise UserError if it cannot be read or is not valid YAML."""
        return cls(read_text(path), path)

    def line(self, place: Sequence[str | int]) -> int | None:
        """Return the line, from 1, of a part or of the nearest part around it; None if the file is empty."""
        path = tuple(place)
        while path not in self._lines:
            if not path:
                return None
            *around, last = path  # a number may be a key, and keys are stored as text
            path = (*around, str(last)) if isinstance(last, int) else tuple(around)
        return self._lines[path]

    def part(self, key: str, data: object) -> YamlFile:
        """Return the part under a key as a YamlFile, whose errors still give the lines of the whole file.

        Args:
            key: a key of the file.
            data: its value, in which texts may have been replaced.
        """
        found = copy(self)
        found.data, lines = data, self._lines.items()
        found._lines = {place[1:]: line for place, line in lines if place[:1] == (key,)}  # noqa: SLF001 - its own
        return found

    def wrong(self, sentence: str, *place: str | int) -> UserError:
        """Return (not raise) a UserError about the part of this file at `place`, with its line."""
        return UserError(sentence, file=self.name, line=self.line(place))

    def validate(self, model: type[FileModel], data: object = None, *, at: YamlPath = ()) -> FileModel:
        """Convert the content to a pydantic model, or raise UserError with the line of a mistake.

        If given, convert only `data`, which is at the path `at` in the file.
        """
        try:
            return model.model_validate(self.data if data is None and not at else data)
        except ValidationError as error:
            first = _select_error(error.errors(include_url=False))
            place = (*at, *first["loc"])
            raise self.wrong(_sentence(first, self._name(place)), *place) from None

    def _name(self, place: YamlPath) -> str:
        if not place:
            return "the file"
        if place[-1] == "[key]":
            return "this key"
        return f'"{place[-1]}"' if isinstance(place[-1], str) and place in self._lines else "this entry"

    def _syntax_error(self, error: yaml.YAMLError) -> UserError:
        problem, context = getattr(error, "problem", None), getattr(error, "context", None)
        mark: Any = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        if isinstance(error, yaml.reader.ReaderError):
            problem = f"the character U+{error.character:04X} is not allowed"
            line = self._text.encode()[: error.position].count(b"\n") + 1
        else:
            line = min(mark.line + 1, len(self._text.splitlines()))  # the mark may be after the end
        sentence = ", ".join(part for part in (context, problem) if part).replace(", but", " but")
        mend = f"; {SYNTAX_MENDS[problem]}" if problem in SYNTAX_MENDS else ""
        return UserError(f"not valid YAML: {sentence}{mend}", file=self.name, line=line)

    def _remember(self, node: yaml.Node, place: YamlPath) -> None:
        self._lines[place] = node.start_mark.line + 1
        if len(place) > MAX_DEPTH or len(self._lines) > MAX_PLACES:
            raise _fault("the text is nested too deeply or repeats too many anchors; simplify the file", node)
        if isinstance(node, yaml.SequenceNode):
            for index, item in enumerate(node.value):
                self._remember(item, (*place, index))
        elif isinstance(node, yaml.MappingNode):
            for key, value in node.value:
                if not isinstance(key, yaml.ScalarNode):
                    raise _fault("this key is not text; write one word or put quotes around it", key)
                if key.tag != TEXT_TAG and not SMALL_NUMBER.fullmatch(key.value):  # hashes may collide
                    raise _fault(f"the key {_quoted(key.value)} is not text; put quotes around it", key)
                inner = (*place, compose(key.value))
                if inner in self._lines:
                    raise _fault(f'the key "{key.value}" is repeated; keep one of them', key)
                self._remember(value, inner)
                self._lines[inner] = key.start_mark.line + 1


# --- pydantic errors in plain English

EXPECTED_TYPES = {
    "string_type": "a string in quotes",
    "list_type": 'a list whose entries begin with "- "',
    "tuple_type": "a list",
    "dict_type": "a mapping of keys to values",
    "model_type": "a mapping of keys to values",
    "float_type": "a number",
    "int_type": "a whole number",
    "bool_type": "true or false",
}
FAULT_WORDS = {
    "extra_forbidden": "the key {name} is unknown; remove it or correct its spelling",
    "invalid_key": "this key is not text; remove it or put quotes around it",
}


def _select_error(errors: Sequence[ErrorDetails]) -> ErrorDetails:
    """Return the first error, or if a key is missing, an unknown one beside it, which may be the same key."""
    first = errors[0]
    unknown = (e for e in errors if e["type"] == "extra_forbidden" and e["loc"][:-1] == first["loc"][:-1])
    return next(unknown, first) if first["type"] == "missing" else first


def _sentence(error: ErrorDetails, name: str) -> str:
    kind, value = error["type"], error["input"]
    if kind == "missing":
        last = error["loc"][-1]
        if isinstance(last, str):
            return f'the key "{last}" is missing'
        return f"this entry has too few values; it needs at least {last + 1}"
    found = "empty" if value is None else _quoted(value)
    if kind in EXPECTED_TYPES:
        return f"{name} is {found}, but it should be {EXPECTED_TYPES[kind]}"
    if kind in FAULT_WORDS:
        return FAULT_WORDS[kind].format(name=name)
    plain = re.sub(r"^\w+ should", "it should", error["msg"].removeprefix("Value error, "))
    return f"{name} is {found}, but {plain[:1].lower()}{plain[1:]}"
