import subprocess
import sys
from pathlib import Path

import pytest
from pydantic import BaseModel, ConfigDict, Field

from codebotler.core.errors import UserError
from codebotler.core.yaml_files import YamlFile


class Inner(BaseModel):
    model_config = ConfigDict(extra="forbid")

    name: str
    size: int = Field(default=1, ge=1)


class Outer(BaseModel):
    model_config = ConfigDict(extra="forbid")

    inner: Inner
    many: list[Inner] = []
    words: dict[str, str] = {}


def error_about(text: str) -> UserError:
    with pytest.raises(UserError) as caught:
        YamlFile(text, "w.yaml").validate(Outer)
    assert caught.value.file == "w.yaml"
    return caught.value


def test_error_names_the_file_and_the_line_if_known() -> None:
    assert str(UserError("is wrong")) == "is wrong"
    assert str(UserError("is wrong", file="a.yaml")) == "a.yaml: is wrong"
    assert str(UserError("is wrong", file=Path("a.yaml"), line=3)) == "a.yaml, line 3: is wrong"


TWICE = "repeated"


@pytest.mark.parametrize(
    ("text", "line", "named"),
    [
        ("inner: [a\nmany: []\n", 2, ["YAML", "did not find expected ',' or ']'"]),
        ("inner:\n  name: a: b\n", 2, ["YAML", "mapping values are not allowed", '": "']),
        ("inner:\n\tname: a\n", 2, ["YAML", "cannot start any token", "spaces"]),
        ("a: 1\n---\nb: 2\n", 2, ["YAML", "found another document"]),
        ("inner: *a\n", 1, ["YAML", "undefined alias"]),
        ("a: \x07\n", 1, ["U+0007"]),
        ("a: 1\nb: !!python/name:os.system 3\n", 2, ["python/name:os.system"]),
        ("a: 1\n{b: 1}: 2\n", 2, ["key", "not text"]),
        ("a: 1\ninner: 2001-13-01\n", 2, ['"2001-13-01"', "quotes"]),
        ("a: 1\n0b_: 1\n", 2, ['"0b_"', "quotes"]),
        (f"a: 1\n? {2**61 - 1}\n: 1\n", 2, [str(2**61 - 1), "not text", "quotes"]),
        ("a: 1\nb: {-1: 2}\n", 2, ["-1", "not text", "quotes"]),
        ("a: 1\nb: {1.5: 2}\n", 2, ["1.5", "not text", "quotes"]),
        ("a: 1\nb: {2001-01-01: 2}\n", 2, ["2001-01-01", "not text", "quotes"]),
        ("a: 1\nb: {!!int '70000': 2}\n", 2, ["70000", "not text", "quotes"]),
        ("a: 1\nb: !!set {12345}\n", 2, ["12345", "not text", "quotes"]),
        (f"a: 1\nb: 1{':00' * 1_000}\n", 2, [":00", "int"]),
        (f"a: 1\nb: 1{':00' * 300}.5\n", 2, [":00", "float"]),
        (f"a: 1\nb: {'9' * 5000}\n", 2, ["9 ... 9", "int"]),
        ("inner: {a: 1\n\n\n", 3, ["YAML", "did not find expected ',' or '}'"]),
        ("inner: 1\nmany: 2\ninner: 3\n", 3, ['"inner"', TWICE]),
        ("1: a\n2: b\n'1': c\n", 3, ['"1"', TWICE]),
        ("words:\n  a: x\n  b: y\n  a: z\n", 4, ['"a"', TWICE]),
    ],
)
def test_invalid_yaml_is_an_error_with_its_line(text: str, line: int, named: list[str]) -> None:
    error = error_about(text)
    assert error.line == line
    assert all(name in error.sentence for name in named), error


@pytest.mark.parametrize(
    ("text", "line", "named"),
    [
        ("", None, ["the file", "empty"]),
        ("# nothing\n", None, ["the file", "empty"]),
        ("- a\n", 1, ["the file", "is [", "a mapping"]),
        ("hello\n", 1, ["the file", 'is "hello"', "a mapping"]),
        ("many: []\n", 1, ['"inner"', "missing"]),
        ("many: []\ninner: {size: 1}\n", 2, ['"name"', "missing"]),
        ("inner: {name: a}\nmani: []\n", 2, ['"mani"', "spelling"]),
        ("inner: {name: a}\n3: []\n", 2, ["this key", "not text"]),
        ("inner:\n  name: 7\n", 2, ['"name"', "is 7", "a string in quotes"]),
        ("inner:\n  name: 1.5\n", 2, ['"name"', "is 1.5", "a string in quotes"]),
        ("inner:\n  name: 2001-01-01\n", 2, ['"name"', "is 2001-01-01", "a string in quotes"]),
        ("inner:\n  name: yes\n", 2, ['"name"', "is True", "a string in quotes"]),
        ("inner:\n  name: off\n", 2, ['"name"', "is False", "a string in quotes"]),
        ("inner:\n  name:\n", 2, ['"name"', "empty"]),
        ("inner:\n  name: [a]\n", 2, ['"name"', "is [", "a string"]),
        ("inner:\n  name: {a: 1}\n", 2, ['"name"', "is {", "a string"]),
        ("inner: {name: a}\nmany:\n  - {name: b}\n  - c\n", 4, ["this entry", 'is "c"', "a mapping"]),
        ("inner: {name: a}\nmany: b\n", 2, ['"many"', 'is "b"', "a list"]),
        ("inner:\n  name: a\n  size: 0\n", 3, ['"size"', " 0,", " 1"]),
        ("inner: {name: a}\nwords:\n  b: x\n  4: y\n", 4, ["this key", "is 4", "a string in quotes"]),
    ],
)
def test_wrong_structure_is_an_error_with_its_line(text: str, line: int | None, named: list[str]) -> None:
    error = error_about(text)
    assert error.line == line
    assert all(name in error.sentence for name in named), error


BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 12)
)


DEEP = "more than 50 levels deep"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        pytest.param("a: 1\ninner: " + "[" * 60 + "]" * 60, 2, id="lists"),
        pytest.param("a: 1\ninner: " + "{a: " * 60 + "1" + "}" * 60, 2, id="mappings"),
        pytest.param("".join(" " * depth + "a:\n" for depth in range(60)), 50, id="indented"),
    ],
)
def test_too_deeply_nested_yaml_is_refused_with_its_line(text: str, line: int) -> None:
    error = error_about(text)
    assert error.line == line
    assert DEEP in error.sentence


@pytest.mark.parametrize(
    ("text", "line"), [(f"a: 1\n{BOMB}", 2), ("a: 1\ninner: &a [*a]\n", 2), ("&a\ninner: *a\n", 1)]
)
def test_exploding_anchors_are_refused_with_their_line(text: str, line: int) -> None:
    error = error_about(text)
    assert error.line == line
    assert "anchors" in error.sentence


def test_an_error_is_one_line() -> None:
    assert str(UserError("a\nb", file="a.yaml", line=1)) == "a.yaml, line 1: a b"


def test_extremely_deep_yaml_does_not_crash_the_interpreter() -> None:
    code = (
        "from codebotler.core.errors import UserError\nfrom codebotler.core.yaml_files import YamlFile\n"
        "try:\n"
        "    YamlFile('[' * 1_000_000, 'w.yaml')\n"
        "except UserError as error:\n"
        "    print(error)\n"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout.count("\n")) == (0, 1), ended
    assert ended.stdout.startswith("w.yaml, line 1: ")
    assert DEEP in ended.stdout


def test_harmless_anchors_are_accepted() -> None:
    file = YamlFile("inner: &a {name: b}\nmany: [*a, *a]\n", "w.yaml")
    assert file.validate(Outer).many == [Inner(name="b"), Inner(name="b")]


def test_line_of_an_unknown_place_is_that_of_its_parent() -> None:
    file = YamlFile("inner:\n  name: a\nmany:\n  - name: b\n\n  - name: c\n", "w.yaml")
    assert [file.line(place) for place in ((), ("inner",), ("inner", "name"), ("many", 1, "name"))] == [
        1, 1, 2, 6,
    ]  # fmt: skip
    assert file.line(("many", 1, "size", 3)) == 6
    assert file.line(("elsewhere",)) == 1
    assert YamlFile("", "w.yaml").line(("elsewhere",)) is None
    assert str(file.wrong("is odd", "many", 0)) == "w.yaml, line 4: is odd"


def test_part_of_a_file_is_validated_with_its_own_lines() -> None:
    file = YamlFile("- {name: a}\n- {name: 3}\n", "w.yaml")
    assert isinstance(file.data, list)
    assert file.validate(Inner, file.data[0], at=(0,)) == Inner(name="a")
    with pytest.raises(UserError, match='"name"') as error:
        file.validate(Inner, file.data[1], at=(1,))
    assert (error.value.file, error.value.line) == ("w.yaml", 2)


def test_a_sentence_is_short_and_one_line() -> None:
    error = UserError("a\nb" + "c" * 10_000, file="a.yaml", line=1)
    assert str(error) == "a.yaml, line 1: a b" + "c" * 297 + " ... " + "c" * 300
