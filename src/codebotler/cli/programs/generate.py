"""`codebotler generate`: ask a model for a program, or for several, of which a person chooses one."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.text import Text

from codebotler.candidates.clusters import compare_candidates
from codebotler.candidates.question import ClarifyingAnswer, ClarifyingQuestion, question_about
from codebotler.checking.check import check
from codebotler.checking.sampled import CheckSettings
from codebotler.checking.storyboard import storyboard
from codebotler.core.errors import UserError
from codebotler.core.terminal import busy, console, note, print_source, shortened, visible
from codebotler.core.text.words import brief, with_sentence
from codebotler.generation.generate import Attempt, gather_candidates, write_checked_program
from codebotler.generation.no_program import ProgramlessReply
from codebotler.models.base import Model
from codebotler.models.open import kind_of, open_model
from codebotler.models.recorded import RECORDED_NOTICE, is_recorded
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt
from codebotler.simulator.worlds.room_map import RoomMap

MAX_REPLY_SHOWN = 300  # how many characters to show of a reply without a program
ADD_SENTENCE = "What should be different? (Enter to give up) "


def write(
    prompt: Prompt,
    model: str,
    settings: SamplingSettings,
    how: CheckSettings,
    room_map: RoomMap | None,
    *,
    retries: int,
    repair: bool,
) -> bool:
    """Have a model write a program, and print it. Return whether it passes the check with settings `how`."""
    with busy(f"asking {model}"):
        opened = open_model(model, settings)
        generation = write_checked_program(
            opened,
            prompt,
            room_map=room_map,
            house_rules=how.house_rules,
            skills=how.skills,
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
    """Print why a reply contains no program, with `which` in front, and quote the reply."""
    hint = "" if none.higher_limit is None else f" --max-tokens {none.higher_limit} raises the limit."
    note(f"{which}{visible(none.sentence)}{hint}")
    if none.kind != "refusal" and none.text.strip():
        note(f"  the reply: {shortened(brief(none.text, MAX_REPLY_SHOWN))}")


def print_prompt(prompt: Prompt, model: str) -> None:
    """Print a prompt as the model receives it: as chat messages, or as text for a base model to continue."""
    if kind_of(model) == "completions":
        print_source(prompt.text)
    else:
        print_source("\n\n".join(f"--- {message.role}\n{message.text}" for message in prompt.messages))


# --- several programs


def choose_candidate(
    opener: Callable[[], Model],
    make_prompt: Callable[[str], Prompt],
    instruction: str,
    settings: CheckSettings,
    room_map: RoomMap | None = None,
    *,
    count: int,
    ask: Callable[[str], str] | None,
) -> str | None:
    """Get several programs from a model. Return the one that a person chooses, or None if there is none.

    If the person wants none of them, they may add a sentence to the instruction for a second round.

    Args:
        opener: opens the model.
        make_prompt: makes the prompt for an instruction.
        instruction: what the robot should do, in plain words.
        settings: the settings for runs in imagined worlds.
        room_map: the rooms; by default those that the programs name.
        count: how many programs to request.
        ask: asks a question and returns the typed line; if None, the most frequent behaviour is taken.
    """
    rejected: ClarifyingQuestion | None = None
    while True:
        opened, prompt = opener(), make_prompt(instruction)
        if rejected is not None:
            prompt = prompt.after(rejected.options[0].program, rejected.rejections)
        with busy(f"asking {opened.name}"):
            attempts = asyncio.run(gather_candidates(opened, prompt, count))
        programs = [one.reply.program for one in attempts if one.programless is None]
        if not programs and attempts[0].programless is not None:
            note_programless(attempts[0].programless)
            return None
        with busy("comparing the programs"):
            groups = compare_candidates(programs, settings, room_map)
        question = question_about(groups, model=opened.name, is_second=rejected is not None)
        if question is None or ask is None:
            note(groups.summary if question is None else f"{groups.summary}; choose one on a terminal")
            return groups.clusters[0].program
        chosen = question.chosen(ask_which(question, ask))
        if chosen is not None:
            return chosen.program
        more = "" if question.why_last else ask(ADD_SENTENCE).strip()
        if not more:
            note("no program chosen")
            return None
        rejected, instruction = question, with_sentence(instruction, more)


def print_checked(program: str, settings: CheckSettings, room_map: RoomMap | None) -> bool:
    """Print a program and its problems, and return whether the check accepts it."""
    print_source(program)
    rules, skills = settings.house_rules, settings.skills
    problems = check(program, room_map=room_map, skills=skills, house_rules=rules).problems
    for problem in problems:
        note(visible(problem.sentence))
    return not problems


def question_view(question: ClarifyingQuestion) -> RenderableType:
    """Return a question for printing: the facts of the imagined world, and a storyboard for each option."""
    parts: list[RenderableType] = [Text("Which did you mean?", "bold"), Text(question.legend)]
    for number, option in enumerate(question.options, 1):
        head = f"{number}: {visible(option.difference)}"
        parts += [Text(), Text.assemble((head, "bold"), (f"  ({option.share})", "dim"))]
        parts.append(Padding(storyboard(option.steps, option.own), (0, 0, 0, 2)))
    if question.left_out:
        parts += [Text(), Text(question.left_out, "dim")]
    last = f'The answer "none" gives up: {question.why_last}.\n' if question.why_last else ""
    return Group(*parts, Text(), Text(last, "dim", end=""))


def ask_which(question: ClarifyingQuestion, read_line: Callable[[str], str]) -> ClarifyingAnswer:
    """Print a question, and read lines until one is an answer. Raise UserError at the end of the input."""
    console(stderr=True).print(question_view(question))
    numbers = ", ".join(str(number) for number in range(1, len(question.options) + 1))
    while True:
        line = read_line(f'Answer {numbers}, "none" or "you decide": ')
        if not line:
            raise UserError("no answer was given; answer `you decide` to take the first option")
        try:
            return question.parse(line)
        except UserError as error:
            note(error.sentence)
