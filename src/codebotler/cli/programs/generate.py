"""`codebotler generate`: ask a model for a program, and ask again as long as the program has problems."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.terminal import busy, note, print_source, shortened, visible
from codebotler.core.text.words import brief
from codebotler.generation.generate import Attempt, write_checked_program
from codebotler.generation.no_program import ProgramlessReply
from codebotler.models.open import kind_of, open_model
from codebotler.models.recorded import RECORDED_NOTICE, is_recorded
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt, prompt_for
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.worlds.room_map import RoomMap

MAX_REPLY_SHOWN = 300  # how many characters to show of a reply without a program


def prompt_maker(
    skills: SkillTable, room_map: RoomMap | None, house_rules: Sequence[Rule]
) -> Callable[[str], Prompt]:
    """Return a function that makes the prompt for an instruction."""
    rooms = () if room_map is None else room_map.described
    return partial(prompt_for, skills=skills, rooms=rooms, rules=[rule.says for rule in house_rules])


def write(
    prompt: Prompt,
    model: str,
    settings: SamplingSettings,
    *,
    room_map: RoomMap | None,
    house_rules: tuple[Rule, ...] = (),
    skills: SkillTable = SKILLS,
    retries: int,
    repair: bool,
) -> bool:
    """Have a model write a program, print it, and return whether the check accepts it."""
    with busy(f"asking {model}"):
        opened = open_model(model, settings)
        generation = write_checked_program(
            opened,
            prompt,
            room_map=room_map,
            house_rules=house_rules,
            skills=skills,
            retries=retries,
            repair=repair,
            on_attempt=partial(_note_attempt, most=retries + 1),
        )
    if generation.programless is None:
        print_source(generation.program)
    if is_recorded(opened.name):
        note(RECORDED_NOTICE)
    return not generation.problems


def _note_attempt(attempt: Attempt, most: int) -> None:
    which = f"attempt {attempt.number + 1} of {most}" if most > 1 else "the program"
    if attempt.programless is not None:
        note_programless(attempt.programless, f"attempt {attempt.number + 1} of {most}: " if most > 1 else "")
    elif attempt.problems:
        note(f"{which} has {'problems' if len(attempt.problems) > 1 else 'a problem'}:")
        for problem in attempt.problems:
            note(f"  {visible(problem)}")
    elif attempt.number:
        note(f"{which} is accepted")


def note_programless(none: ProgramlessReply, which: str = "") -> None:
    """Print a note about why a reply contains no program, and quote the reply."""
    hint = "" if none.higher_limit is None else f" --max-tokens {none.higher_limit} raises the limit."
    note(f"{which}{visible(none.sentence)}{hint}")
    if none.kind != "refusal" and none.text.strip():
        note(f"  the reply: {shortened(brief(none.text, MAX_REPLY_SHOWN))}")


def print_prompt(prompt: Prompt, model: str) -> None:
    """Print a prompt as the model receives it: as chat messages, or as text for a base model to continue."""
    kind = kind_of(model)
    if kind == "completions":
        print_source(prompt.text)
    else:
        print_source("\n\n".join(f"--- {message.role}\n{message.text}" for message in prompt.messages))
    if kind == "hf":
        note(
            f"{model} gets these messages if its tokenizer has a chat template, or else the text "
            "that --model completions:NAME shows"
        )
