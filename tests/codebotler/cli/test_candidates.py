"""`--candidates` takes the most frequent behaviour, or asks the person which one is meant."""

from collections.abc import Sequence
from pathlib import Path

import pytest

import command_line
from codebotler.checking.sampled import CheckSettings
from codebotler.cli.programs.generate import choose_candidate
from codebotler.core.errors import UserError
from codebotler.models.recorded import open_recorded
from codebotler.prompts import prompt_for
from command_line import Ended, Refusal, command
from doubles import FakeModel
from roboeval.suites.load import Suite

SAYS = 'def task_program():\n    say("{} mugs")\n'
ONE, TWO, THREE, FOUR = map(SAYS.format, range(1, 5))
STAPLER = next(one for one in open_recorded("recorded").replies if one.startswith("Check every printer"))


class Terminal:
    """A person who answers with the given lines, and a model that writes the given programs."""

    def __init__(
        self, programs: Sequence[str], *lines: str, model: str = "several", later: Sequence[str] = ()
    ) -> None:
        self.rounds, self.lines, self.model = [programs, *[later] * bool(later)], list(lines), model
        self.asked_models: list[FakeModel] = []
        self.asked: list[str] = []

    def open(self) -> FakeModel:
        model = FakeModel(self.rounds[min(len(self.asked_models), len(self.rounds) - 1)])
        model.name = self.model
        self.asked_models.append(model)
        return model

    @property
    def instructions(self) -> list[str]:
        return [model.prompts[0].instruction for model in self.asked_models]

    def read(self, question: str) -> str:
        self.asked.append(question)
        return self.lines.pop(0)

    def choose(self, *, asks: bool = True) -> str | None:
        ask, count = self.read if asks else None, len(self.rounds[0])
        return choose_candidate(
            self.open, prompt_for, "Count the mugs.", CheckSettings(), count=count, ask=ask
        )


def test_without_a_terminal_the_largest_cluster_is_taken(capsys: pytest.CaptureFixture[str]) -> None:
    person = Terminal([TWO, ONE, ONE])
    assert person.choose(asks=False) == ONE
    assert "2 of 3 programs" in capsys.readouterr().err


def test_nothing_is_asked_if_all_do_the_same() -> None:
    person = Terminal([ONE, ONE])
    assert person.choose() == ONE
    assert person.asked == []


def test_the_person_chooses_an_option(capsys: pytest.CaptureFixture[str]) -> None:
    person = Terminal([ONE, ONE, TWO], "5\n", "2\n")
    assert person.choose() == TWO
    assert len(person.asked) == 2, "the question is repeated after an unusable line"
    shown = capsys.readouterr()
    assert 'says "2 mugs"' in shown.err
    assert shown.out == "", "standard output is for the program"


def test_none_of_these_adds_a_sentence_for_a_second_round() -> None:
    person = Terminal([ONE, TWO], "none\n", "Only clean ones.\n", "1\n", later=[THREE, FOUR])
    assert person.choose() == THREE
    assert "did not mean a robot that" in person.asked_models[1].prompts[0].messages[-1].text
    assert person.instructions == ["Count the mugs.", "Count the mugs. Only clean ones."]


def test_there_is_no_third_round() -> None:
    person = Terminal([ONE, TWO], "none\n", "Only clean ones.\n", "none\n", later=[THREE, FOUR])
    assert person.choose() is None
    assert len(person.instructions) == 2


def test_what_was_rejected_may_be_right_with_the_added_words() -> None:
    """The question has shown only one case, and the words may be about another one."""
    assert Terminal([ONE, TWO], "none\n", "Only clean ones.\n", later=[ONE, ONE]).choose() == ONE


def test_no_sentence_is_requested_for_a_recorded_model(capsys: pytest.CaptureFixture[str]) -> None:
    person = Terminal([ONE, TWO], "none\n", model="recorded:careful")
    assert person.choose() is None
    assert len(person.instructions) == 1
    assert "recorded model" in capsys.readouterr().err


def test_the_person_may_give_up() -> None:
    person = Terminal([ONE, TWO], "none\n", "\n")
    assert person.choose() is None
    assert len(person.instructions) == 1


def test_end_of_input_is_not_an_answer() -> None:
    with pytest.raises(UserError, match="you decide"):
        Terminal([ONE, TWO], "").choose()


def test_replies_without_a_program_do_not_count() -> None:
    assert Terminal(["", "", ONE]).choose() == ONE
    assert Terminal(["", ""]).choose() is None


def codebotler(*words: str, cwd: Path) -> Ended:
    return command("codebotler", *words, cwd=cwd)


def refusal_of(*words: str | Path) -> Refusal:
    return command_line.refused(*words, name="codebotler")


@pytest.mark.slow
def test_generate_prints_the_chosen_program(tmp_path: Path, paper: Suite) -> None:
    words = "generate", paper.tasks["FindBackpack"].prompts[0], "--model", "recorded:hasty"
    ended = codebotler(*words, "--candidates", "6", cwd=tmp_path)
    assert ended.status == 0
    assert ended.out.startswith("def task_program")
    assert "the check rejected 4" in ended.err


@pytest.mark.slow
def test_run_runs_the_chosen_program(tmp_path: Path) -> None:
    (tmp_path / "world.yaml").write_text(
        "robot: start_loc\nrooms: [start_loc, printer room 1]\nobjects: {printer room 1: [stapler]}\n"
    )
    words = "run", STAPLER, "--model", "recorded:hasty", "--world", "world.yaml", "--speed", "1000"
    ended = codebotler(*words, "--candidates", "3", "--yes", cwd=tmp_path)
    assert ended.status == 0
    assert "all of 3 programs" in ended.err
    assert "stapler" in ended.out


def test_candidates_need_an_instruction(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(ONE)
    assert "instruction" in refusal_of("run", tmp_path / "program.py", "--candidates", "3").sentence


@pytest.mark.parametrize("more", [("--retries", "1"), ("--repair",)])
def test_candidates_and_repairs_exclude_each_other(more: tuple[str, ...]) -> None:
    assert "--candidates" in refusal_of("generate", STAPLER, "--candidates", "3", *more).sentence
