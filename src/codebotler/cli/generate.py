"""`codebotler generate`: asks a model for a program, and again while there are problems."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

from codebotler.core.files import Appender, expect_replaceable, to_line
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.terminal import busy, note, print_source, shortened, visible
from codebotler.core.words import brief
from codebotler.core.world import World
from codebotler.generation.generate import Attempt, ignore, write_checked_program
from codebotler.generation.no_program import ProgramlessReply
from codebotler.missions.preflight import with_closest_here
from codebotler.models.open import kind_of, open_model
from codebotler.models.recorded import NOTICE, UnknownInstructionError, is_recorded
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt
from codebotler.simulator.house_rule import Rule
from codebotler.simulator.sampled_robot import RoomMap

MOST_SAID = 300  # characters of a reply without a program


def write(
    prompt: Prompt,
    model: str,
    settings: SamplingSettings,
    *,
    world: World | None,
    house_rules: tuple[Rule, ...] = (),
    skills: SkillTable = SKILLS,
    retries: int,
    repair: bool,
    record: Path | None,
) -> bool:
    """Have a model write a program, print it, and say whether the check accepts it."""
    with ExitStack() as recording:
        with busy(f"asking {model}"):
            asked = open_model(model, settings)
            note_down = recording.enter_context(recorder(record, asked.name))

            def tried(attempt: Attempt) -> None:
                note_down(attempt)
                _tell(attempt, retries + 1)

            room_map = None if world is None else RoomMap.of(world)
            try:
                made = write_checked_program(
                    asked,
                    prompt,
                    room_map=room_map,
                    house_rules=house_rules,
                    skills=skills,
                    retries=retries,
                    repair=repair,
                    tried=tried,
                )
            except UnknownInstructionError as error:
                raise with_closest_here(error, room_map) from None
        if made.programless is None:
            print_source(made.program)
    if is_recorded(asked.name):
        note(NOTICE)
    return not made.problems


@contextmanager
def recorder(path: Path | None, model: str) -> Iterator[Callable[[Attempt], None]]:
    """Adds attempts to a file, each when it has ended; without a file, nothing.

    An OSError comes at the end, so that the program is printed all the same.
    """
    if path is None:
        yield ignore
        return
    expect_replaceable(path, b"{")
    failed: OSError | None = None
    with closing(Appender(path)) as file:

        def add(attempt: Attempt) -> None:
            nonlocal failed
            if failed is None:
                try:
                    file.append(to_line(attempt.data(model)))
                except OSError as error:
                    failed = error

        yield add
    if failed is not None:
        raise failed


def _tell(attempt: Attempt, most: int) -> None:
    which = f"attempt {attempt.number + 1} of {most}" if most > 1 else "the program"
    if attempt.programless is not None:
        tell_programless(attempt.programless, f"attempt {attempt.number + 1} of {most}: " if most > 1 else "")
    elif attempt.problems:
        note(f"{which} has {'problems' if len(attempt.problems) > 1 else 'a problem'}:")
        for problem in attempt.problems:
            note(f"  {visible(problem)}")
    elif attempt.number:
        note(f"{which} is accepted")


def tell_programless(none: ProgramlessReply, which: str = "") -> None:
    """Say why there is no program, and what the reply says instead."""
    hint = "" if none.higher_limit is None else f" --max-tokens {none.higher_limit} sets a higher limit."
    note(f"{which}{visible(none.sentence)}{hint}")
    if none.kind != "refusal" and none.text.strip():
        note(f"  it says: {shortened(brief(none.text, MOST_SAID))}")


def show(prompt: Prompt, model: str) -> None:
    """Print what a model is asked: the messages of a chat, or the one text that base models go on from."""
    kind = kind_of(model)
    if kind == "completions":
        print_source(prompt.text)
    else:
        print_source("\n\n".join(f"--- {message.role}\n{message.text}" for message in prompt.messages))
    if kind == "hf":
        note(
            f"these are the messages that {model} gets if its tokenizer has a chat template; "
            "without one it gets the text that --model completions:NAME shows"
        )
