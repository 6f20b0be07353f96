import re
import subprocess
import sys
from pathlib import Path

import pytest
from pydantic import BaseModel, ConfigDict, Field

from codebotler.badinput import MAX_BYTES, BadInput, YamlFile, read_text, text_of


class Inner(BaseModel):
    model_config = ConfigDict(extra="forbid")

    name: str
    size: int = Field(default=1, ge=1)


class Outer(BaseModel):
    model_config = ConfigDict(extra="forbid")

    inner: Inner
    many: list[Inner] = []
    words: dict[str, str] = {}


def sentence_about(text: str) -> str:
    with pytest.raises(BadInput) as caught:
        YamlFile(text, "w.yaml").validate(Outer)
    return str(caught.value)


def test_error_names_the_file_and_the_line_where_there_are_any() -> None:
    assert str(BadInput("is wrong")) == "is wrong"
    assert str(BadInput("is wrong", file="a.yaml")) == "a.yaml: is wrong"
    assert str(BadInput("is wrong", file=Path("a.yaml"), line=3)) == "a.yaml, line 3: is wrong"


TOO_LARGE = (
    'w.yaml, line 2: "{} ... {}" is too large a number; write a smaller one, or put quotes around a text'
)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "inner: [a\nmany: []\n",
            (
                "w.yaml, line 2: this is no valid YAML: while parsing a flow sequence, "
                "did not find expected ',' or ']'"
            ),
        ),
        (
            "inner:\n  name: a: b\n",
            (
                "w.yaml, line 2: this is no valid YAML: mapping values are not allowed in this context; "
                'put quotes around a text that holds ": "'
            ),
        ),
        (
            "inner:\n\tname: a\n",
            (
                "w.yaml, line 2: this is no valid YAML: while scanning for the next token, found character "
                "that cannot start any token; put quotes around a text, and indent with spaces"
            ),
        ),
        (
            "a: 1\n---\nb: 2\n",
            (
                "w.yaml, line 2: this is no valid YAML: "
                "expected a single document in the stream but found another document"
            ),
        ),
        ("inner: *a\n", "w.yaml, line 1: this is no valid YAML: found undefined alias"),
        ("a: \x07\n", "w.yaml, line 1: the character U+0007 may not stand in YAML; remove it"),
        (
            "a: 1\nb: !!python/name:os.system 3\n",
            'w.yaml, line 2: the tag "python/name:os.system" is not supported; remove it',
        ),
        (
            "a: 1\n{b: 1}: 2\n",
            "w.yaml, line 2: this key is no text; write one word or put quotes around it",
        ),
        ("a: 1\nb: x\ud800\n", "w.yaml, line 2: the character U+D800 may not stand in YAML; remove it"),
        (
            "a: 1\ninner: 2001-13-01\n",
            'w.yaml, line 2: "2001-13-01" is not a date; correct it or put quotes around it',
        ),
        (
            "a: 1\n0b_: 1\n",
            'w.yaml, line 2: "0b_" is not a whole number; correct it or put quotes around it',
        ),
        ("inner: !!bool x\n", 'w.yaml, line 1: "x" is not true or false; correct it or put quotes around it'),
        ("inner: !!timestamp x\n", 'w.yaml, line 1: "x" is not a date; correct it or put quotes around it'),
        (f"a: 1\nb: {'9' * 5000}\n", long := TOO_LARGE.format("9" * 20, "9" * 20)),
        (f"a: 1\nb: {'9' * 400}\n", long),
        (f"a: 1\nb: 0x{'f' * 5000}\n", TOO_LARGE.format("0x" + "f" * 18, "f" * 20)),
        ("a: 1\nb: !!set {x}\n", 'w.yaml, line 2: the tag "set" is not supported; remove it'),
        ("a: 1\n!!set b: x\n", 'w.yaml, line 2: the tag "set" is not supported; remove it'),
        ("a: =\n", 'w.yaml, line 1: "=" alone is no text; put quotes around it'),
        (
            "inner: {a: 1\n\n\n",
            (
                "w.yaml, line 3: this is no valid YAML: while parsing a flow mapping, "
                "did not find expected ',' or '}'"
            ),
        ),
        (
            "inner: 1\nmany: 2\ninner: 3\n",
            keyed := 'w.yaml, line 3: the key "inner" stands here a second time; keep one of them',
        ),
        ("1: a\n2: b\n'1': c\n", keyed.replace("inner", "1")),
        ("words:\n  a: x\n  b: y\n  a: z\n", keyed.replace("inner", "a").replace("line 3", "line 4")),
        (
            "inner:\n  <<: {name: a}\n",
            'w.yaml, line 2: merging with "<<" is not supported; write the keys out',
        ),
    ],
)
def test_what_is_no_yaml_is_told_in_a_sentence_with_the_line(text: str, sentence: str) -> None:
    assert sentence_about(text) == sentence


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "w.yaml: the file is empty; fill it in or remove it"),
        ("# nothing\n", "w.yaml: the file is empty; fill it in or remove it"),
        ("- a\n", "w.yaml, line 1: the file is a list, not a mapping of keys to values"),
        ("hello\n", "w.yaml, line 1: the file is a text, not a mapping of keys to values"),
        ("many: []\n", 'w.yaml, line 1: the key "inner" is missing'),
        ("many: []\ninner: {size: 1}\n", 'w.yaml, line 2: the key "name" is missing'),
        (
            "inner: {name: a}\nmani: []\n",
            'w.yaml, line 2: the key "mani" means nothing here; remove it or correct its spelling',
        ),
        (
            "inner: {name: a}\n3: []\n",
            "w.yaml, line 2: this key is no text; remove it or put quotes around it",
        ),
        ("inner:\n  name: 7\n", 'w.yaml, line 2: "name" is a number, not a text; put quotes around it'),
        ("inner:\n  name: 1.5\n", 'w.yaml, line 2: "name" is a number, not a text; put quotes around it'),
        (
            "inner:\n  name: 2001-01-01\n",
            'w.yaml, line 2: "name" is a date, not a text; put quotes around it',
        ),
        (
            "inner:\n  name: yes\n",
            'w.yaml, line 2: "name" is a truth value, not a text; put quotes around it ("yes")',
        ),
        (
            "inner:\n  name: off\n",
            'w.yaml, line 2: "name" is a truth value, not a text; put quotes around it ("no")',
        ),
        ("inner:\n  name:\n", 'w.yaml, line 2: "name" is empty; fill it in or remove it'),
        ("inner:\n  name: [a]\n", 'w.yaml, line 2: "name" is a list, not a text'),
        ("inner:\n  name: {a: 1}\n", 'w.yaml, line 2: "name" is a mapping, not a text'),
        (
            "inner: {name: a}\nmany:\n  - {name: b}\n  - c\n",
            "w.yaml, line 4: this entry is a text, not a mapping of keys to values",
        ),
        ("inner: {name: a}\nmany: b\n", 'w.yaml, line 2: "many" is a text, not a list'),
        (
            "inner:\n  name: a\n  size: 0\n",
            'w.yaml, line 3: "size" is 0, but it should be greater than or equal to 1',
        ),
        (
            "inner: {name: a}\nwords:\n  b: x\n  4: y\n",
            "w.yaml, line 4: this key is a number, not a text; put quotes around it",
        ),
    ],
)
def test_what_has_another_form_is_told_in_a_sentence_with_line_and_mend(text: str, sentence: str) -> None:
    assert sentence_about(text) == sentence


BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 12)
)


DEEP = "w.yaml, line {}: this is nested more than 50 deep, or within itself; write it flatter"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        pytest.param("a: 1\ninner: " + "[" * 60 + "]" * 60, 2, id="lists"),
        pytest.param("a: 1\ninner: " + "{a: " * 60 + "1" + "}" * 60, 2, id="mappings"),
        pytest.param("".join(" " * depth + "a:\n" for depth in range(60)), 50, id="indented"),
        pytest.param("a: 1\ninner: &a [*a]\n", 2, id="a list within itself"),
        pytest.param("&a\ninner: *a\n", 1, id="a mapping within itself"),
    ],
)
def test_yaml_that_is_nested_too_deeply_is_refused_in_a_sentence(text: str, line: int) -> None:
    assert sentence_about(text) == DEEP.format(line)


def test_anchors_that_explode_are_refused_in_a_sentence() -> None:
    assert sentence_about(f"a: 1\n{BOMB}") == (
        "w.yaml, line 2: up to here there are 100,000 entries, too many, or anchors repeat them"
    )


def test_a_sentence_is_short_and_one_line() -> None:
    error = BadInput("a\nb" + "c" * 10_000, file="a.yaml", line=1)
    assert str(error) == "a.yaml, line 1: a b" + "c" * 297 + " ... " + "c" * 300


def test_yaml_so_deep_that_the_c_stack_would_overflow_does_not_crash_the_interpreter() -> None:
    code = (
        "from codebotler.badinput import YamlFile, BadInput\n"
        "try:\n"
        "    YamlFile('[' * 1_000_000, 'w.yaml')\n"
        "except BadInput as error:\n"
        "    print(error)\n"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout) == (
        0,
        DEEP.format(1) + "\n",
    )


def test_anchors_that_repeat_a_little_are_fine() -> None:
    file = YamlFile("inner: &a {name: b}\nmany: [*a, *a]\n", "w.yaml")
    assert file.validate(Outer).many == [Inner(name="b"), Inner(name="b")]


def test_every_place_has_its_line_and_an_unknown_one_that_of_what_is_around_it() -> None:
    file = YamlFile("inner:\n  name: a\nmany:\n  - name: b\n\n  - name: c\n", "w.yaml")
    assert [file.line(place) for place in ((), ("inner",), ("inner", "name"), ("many", 1, "name"))] == [
        1, 1, 2, 6,
    ]  # fmt: skip
    assert file.line(("many", 1, "size", 3)) == 6
    assert file.line(("elsewhere",)) == 1
    assert YamlFile("", "w.yaml").line(("elsewhere",)) is None
    assert str(file.wrong("is odd", "many", 0)) == "w.yaml, line 4: is odd"


def test_part_of_a_file_is_validated_where_it_stands() -> None:
    file = YamlFile("- {name: a}\n- {name: 3}\n", "w.yaml")
    assert isinstance(file.data, list)
    assert file.validate(Inner, file.data[0], at=(0,)) == Inner(name="a")
    with pytest.raises(BadInput, match=re.escape('w.yaml, line 2: "name" is a number, not a text')):
        file.validate(Inner, file.data[1], at=(1,))


def test_byte_order_mark_is_no_part_of_the_text() -> None:
    assert text_of(b"\xef\xbb\xbfdef f(): ...\r\n", "f.py") == "def f(): ...\n"


def test_missing_file_folder_no_utf8_and_too_large_are_told_in_a_sentence(tmp_path: Path) -> None:
    def sentence(path: Path) -> str:
        with pytest.raises(BadInput) as caught:
            YamlFile.read(path)
        return str(caught.value)

    missing, latin, large = tmp_path / "no.yaml", tmp_path / "latin.yaml", tmp_path / "large.yaml"
    latin.write_bytes("a: 1\nb: café\n".encode("latin-1"))
    large.write_bytes(b"a" * (MAX_BYTES + 1))
    assert sentence(missing) == f"{missing}: there is no such file"
    assert sentence(tmp_path) == f"{tmp_path}: is a folder; name a file"
    assert sentence(latin) == f"{latin}, line 2: is no UTF-8 text; save it as UTF-8"
    assert sentence(large) == f"{large}: is larger than 5,000,000 bytes"
    assert sentence(missing / "inside") == f"{missing}/inside: there is no such file"
    assert sentence(latin / "inside") == f"{latin}/inside: cannot be read (Not a directory)"


def test_file_without_an_end_is_too_large_instead_of_being_read_for_ever() -> None:
    with pytest.raises(BadInput, match=r"^/dev/zero: is larger than 10 bytes$"):
        read_text(Path("/dev/zero"), limit=10)


def test_line_ends_of_every_system_are_read_as_one(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes("ä\r\nb\rc\n".encode())
    assert read_text(path) == "ä\nb\nc\n"
    assert read_text(path, limit=8) == "ä\nb\nc\n"
    with pytest.raises(BadInput, match="larger than 7 bytes"):
        read_text(path, limit=7)
