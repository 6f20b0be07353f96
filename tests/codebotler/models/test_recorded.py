import ast
from pathlib import Path

import pytest

from codebotler.badinput import BadInput
from codebotler.models.recorded import NAMES, read_replies, recorded_model


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", ["recorded", "recorded:", "recorded:careful", "careful"])
def test_careful_model_is_the_one_that_is_meant_by_recorded(name: str) -> None:
    assert recorded_model(name).name == "careful"


def test_unknown_recorded_model_is_told_in_a_sentence() -> None:
    with pytest.raises(BadInput) as caught:
        recorded_model("recorded:lazy")
    assert str(caught.value) == (
        'there is no recorded model "recorded:lazy"; there are recorded:careful, recorded:hasty'
    )


def test_replies_come_round_again() -> None:
    model = recorded_model("recorded:hasty")
    for instruction, replies in model.replies.items():
        assert [model.reply(instruction, i) for i in range(2 * len(replies))] == [*replies, *replies]


def test_nobody_recorded_an_instruction_of_ones_own() -> None:
    with pytest.raises(KeyError):
        recorded_model("recorded").reply("Fetch me a coffee", 0)


def test_both_models_know_the_same_eighty_instructions() -> None:
    careful, hasty = (recorded_model(name).replies for name in NAMES)
    assert set(careful) == set(hasty)
    assert len(careful) == 80


@pytest.mark.parametrize("name", NAMES)
def test_every_recorded_program_defines_its_task_or_is_said_not_to_parse(name: str) -> None:
    for replies in recorded_model(name).replies.values():
        assert replies
        for reply in replies:
            assert reply.about
            assert "def task_program" in reply.program
            try:
                ast.parse(reply.program)
            except SyntaxError as error:
                assert reply.fails == type(error).__name__  # noqa: PT017 - most parse
            else:
                assert reply.fails != "SyntaxError"


def test_careful_model_is_right_more_often_than_the_hasty_one() -> None:
    def share(name: str) -> float:
        marks = [
            reply.fails is None for replies in recorded_model(name).replies.values() for reply in replies
        ]
        return sum(marks) / len(marks)

    assert 1 > share("careful") > share("hasty") > 0


def test_file_of_replies_is_read_and_its_faults_are_told_with_their_line(tmp_path: Path) -> None:
    good = "- instruction: Wave.\n  replies:\n    - about: a\n      program: |\n        say('b')\n"
    (reply,) = read_replies(write(tmp_path / "a.yaml", good))["Wave."]
    assert (reply.about, reply.program, reply.fails) == ("a", "say('b')\n", None)
    path = write(tmp_path / "b.yaml", good + "    - about: b\n")
    with pytest.raises(BadInput) as caught:
        read_replies(path)
    assert str(caught.value) == f'{path}, line 6: the key "program" is missing'


def test_file_that_is_no_list_is_no_file_without_replies(tmp_path: Path) -> None:
    with pytest.raises(BadInput):
        read_replies(write(tmp_path / "a.yaml", "instruction: Wave.\nreplies: []\n"))


def test_instruction_without_replies_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput):
        read_replies(write(tmp_path / "a.yaml", "- instruction: Wave.\n  replies: []\n"))
