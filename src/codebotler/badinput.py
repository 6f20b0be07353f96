"""The one kind of error that a user can cause, and YAML read so that every error names its line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeAlias, TypeVar

import yaml
from pydantic import BaseModel, ValidationError

Place: TypeAlias = tuple[str | int, ...]
Model = TypeVar("Model", bound=BaseModel)

Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
MAX_BYTES = 5_000_000


class BadInput(ValueError):  # noqa: N818 - named for what it says to the user, not for where it is raised
    """Something a user gave cannot be used; its text is one sentence that says where and how to mend it.

    Args:
        sentence: what is wrong and, where it helps, the mend.
        file: the file it stands in.
        line: the line, counted from 1.
    """

    def __init__(self, sentence: str, *, file: Path | str | None = None, line: int | None = None) -> None:
        self.sentence, self.file, self.line = sentence, file, line
        where = "" if file is None else f"{file}: " if line is None else f"{file}, line {line}: "
        super().__init__(where + sentence)


class YamlFile:
    """A parsed YAML file that remembers on which line everything stands.

    Args:
        text: the file's content.
        name: what error sentences call the file.

    Raises:
        BadInput: it is no YAML, or a key stands twice in one mapping.
    """

    def __init__(self, text: str, name: Path | str) -> None:
        self.name = name
        self._lines: dict[Place, int] = {}
        try:
            loader = Loader(text)
            node = loader.get_single_node()
            self.data: object = None if node is None else loader.construct_document(node)
        except yaml.YAMLError as error:
            raise self._syntax(error) from None
        except (RecursionError, ValueError) as error:
            raise BadInput(f"cannot be read as YAML ({error})", file=name) from None
        if node is not None:
            self._remember(node, ())

    @classmethod
    def read(cls, path: Path) -> YamlFile:
        """Read and parse a file.

        Raises:
            BadInput: it is missing, unreadable, too large, or no YAML.
        """
        return cls(read_text(path), path)

    def line(self, place: Sequence[str | int]) -> int | None:
        """The line of what stands at a path of keys and positions, or of the nearest thing around it."""
        path = tuple(place)
        while path not in self._lines:
            if not path:
                return None
            path = path[:-1]
        return self._lines[path]

    def wrong(self, sentence: str, *place: str | int) -> BadInput:
        """The error that says a sentence about what stands at a place."""
        return BadInput(sentence, file=self.name, line=self.line(place))

    def validate(self, model: type[Model], data: object = None, *, at: Place = ()) -> Model:
        """This file's content (or a part of it) as a model.

        Args:
            model: what it must look like.
            data: the part; everything by default.
            at: where the part stands.

        Raises:
            BadInput: it does not look like it; the sentence is about the first fault.
        """
        try:
            return model.model_validate(self.data if data is None and not at else data)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            place = (*at, *first["loc"])
            raise self.wrong(_sentence(first["type"], first["msg"], place, first["input"]), *place) from None

    def _syntax(self, error: yaml.YAMLError) -> BadInput:
        mark = getattr(error, "problem_mark", None)
        problem = getattr(error, "problem", None) or "unreadable"
        return BadInput(
            f"this is no valid YAML: {problem}", file=self.name, line=None if mark is None else mark.line + 1
        )

    def _remember(self, node: yaml.Node, place: Place) -> None:
        self._lines[place] = node.start_mark.line + 1
        if isinstance(node, yaml.SequenceNode):
            for index, item in enumerate(node.value):
                self._remember(item, (*place, index))
        elif isinstance(node, yaml.MappingNode):
            for key, value in node.value:
                inner = (*place, str(key.value))
                if inner in self._lines:
                    raise BadInput(
                        f'the key "{key.value}" stands here a second time; keep one of them',
                        file=self.name,
                        line=key.start_mark.line + 1,
                    )
                self._remember(value, inner)
                self._lines[inner] = key.start_mark.line + 1


def read_text(path: Path, *, limit: int = MAX_BYTES) -> str:
    """Read a text file of reasonable size.

    Args:
        path: the file.
        limit: the largest size in bytes.

    Raises:
        BadInput: it is missing, a folder, unreadable, larger than the limit, or no UTF-8.
    """
    try:
        if path.stat().st_size > limit:
            raise BadInput(f"is larger than {limit:,} bytes", file=path)
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise BadInput("there is no such file", file=path) from None
    except UnicodeDecodeError as error:
        raise BadInput(f"is no UTF-8 text (byte {error.start})", file=path) from None
    except OSError as error:
        raise BadInput(f"cannot be read ({error.strerror})", file=path) from None


def _sentence(kind: str, message: str, place: Place, value: object) -> str:
    name = f'"{place[-1]}"' if place and isinstance(place[-1], str) else "this entry"
    if kind == "extra_forbidden":
        return f"the key {name} means nothing here; remove it or correct its spelling"
    if kind == "missing":
        return f"the key {name} is missing"
    if isinstance(value, bool) and "string" in kind:
        word = "yes" if value else "no"
        return f'{name} is a truth value, not a text; put quotes around it ("{word}")'
    if isinstance(value, Mapping | Sequence) and not isinstance(value, str):
        return f"{name} is not as it should be: {_plain(message)}"
    return f"{name} is {value!r}, but {_plain(message)}"


def _plain(message: str) -> str:
    plain = message.removeprefix("Value error, ").replace("Input should be", "it should be")
    return plain[:1].lower() + plain[1:]
