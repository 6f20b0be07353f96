"""Render an instruction as chat messages, and as a string for base models to continue."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from itertools import islice
from pathlib import Path
from string import Template
from typing import Literal

from codebotler.core.errors import UserError, expect_list
from codebotler.core.program import TASK_FUNCTION, Flaw, called_skills, parse_leniently, parse_program
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill, SkillTable
from codebotler.core.text.unicode import compose
from codebotler.core.text.words import listed

PROMPT_FOLDER = Path(__file__).parent
OPENING = f"def {TASK_FUNCTION}():\n"
MAX_SEARCHED_LENGTH, MAX_END_TRIES = 100_000, 20  # limits of the search for the end of a function
STOP_TEXTS = ("\ndef ", "\nclass ", "\n# Instruction", "\n```")  # OpenAI accepts at most four


NO_STEP = "no step was finished"
"""The text that a prompt shows instead of steps if the mission has none."""


@dataclass(frozen=True)
class PromptMessage:
    """One turn of a conversation with a chat model."""

    role: Literal["system", "user", "assistant", "tool"]
    text: str


@dataclass(frozen=True)
class PictureMessage(PromptMessage):
    """A turn that includes a picture, as a JPEG file."""

    jpeg: bytes


@dataclass(frozen=True)
class Example:
    """An instruction with a correct program that prompts show as an example."""

    instruction: str
    program: str
    skills: frozenset[str]  # the names of the skills that the program calls


@dataclass(frozen=True)
class Prompt:
    """A request for a program, in a form for chat models and a form for base models."""

    instruction: str
    messages: tuple[PromptMessage, ...] = field(repr=False)  # for chat models
    text: str = field(repr=False)  # for base models; ends with `opening`
    stop: tuple[str, ...]  # texts before which base models stop
    opening: str  # the start of the program that base models continue
    last_step: str = ""  # of the mission whose rest is requested, in words; empty for a new mission

    def after(self, program: str, problems: Sequence[str]) -> Prompt:
        """Return this prompt, followed by a program and a request to fix its problems."""
        return self._followed("repair", program, problems=list_lines(problems))

    def to_continue(self, program: str, steps: Sequence[str], why: str, here: str, last_step: str) -> Prompt:
        """Return this prompt, followed by a request to write the rest of a mission that ended early.

        Args:
            program: the program that the robot ran.
            steps: what the robot did and saw, each in words.
            why: why the mission ended, in a sentence.
            here: where the robot is and what it holds, in a sentence.
            last_step: the last of the steps that did not fail; empty if there is none.
        """
        done = list_lines(steps or [NO_STEP])
        followed = self._followed("continue", program, steps=done, why=why, here=here)
        return replace(followed, last_step=last_step or NO_STEP)

    def _followed(self, name: str, program: str, **values: str) -> Prompt:
        """Return this prompt with a program and the request `name`, which base models read as comments."""
        answer = PromptMessage("assistant", _fence(program))
        request = PromptMessage("user", fill_template(name, **values))
        comments = _comment(fill_template(f"completion-{name}", program=program.rstrip("\n"), **values))
        text = f"{self.text.removesuffix(self.opening)}{comments}\n{self.opening}"
        return replace(self, messages=(*self.messages, answer, request), text=text)

    def after_no_program(self, why: str) -> Prompt:
        """Return this prompt for chat models, with the reason why the last reply had no program."""
        *before, request = self.messages
        asked = f"{request.text}\n\n{fill_template('no-program', why=why)}"
        return replace(self, messages=(*before, replace(request, text=asked)))

    def program_from(self, reply: str) -> str:
        """Return the program from a base model's reply: `opening` and the lines that continue it."""
        if re.match(rf"\s*(```|(async )?def {TASK_FUNCTION}\b)", reply):
            return reply  # the model started the program again
        return self.opening + reply[: task_end(self.opening, reply, self.stop)]


def task_end(opening: str, reply: str, stop: Sequence[str] = STOP_TEXTS) -> int:
    """Return the index at which a base model's reply completes the function begun by `opening`.

    This is before the first unindented line outside brackets and strings, or before a `stop` text.
    """
    stops = [at for at in (reply.find(text) for text in stop) if at >= 0]
    end = min(stops, default=len(reply))
    outer_lines = re.finditer(r"\n(?=[^\s#)\]}])", reply[: min(end, MAX_SEARCHED_LENGTH)])
    for found in islice(outer_lines, MAX_END_TRIES):
        if not isinstance(parse_program(opening + reply[: found.start()]), Flaw):
            return found.start()
    return end


def clean_instruction(instruction: str) -> str:
    """Return an instruction without outer spaces and in Unicode form NFC. Raise UserError if it is empty."""
    if not (instruction := compose(instruction.strip())):
        raise UserError("the instruction is empty; say what the robot should do")
    return instruction


def prompt_for(
    instruction: str,
    *,
    rooms: Sequence[str] = (),
    rules: Sequence[str] = (),
    skills: SkillTable = SKILLS,
) -> Prompt:
    """Return the prompt that asks a model to write a program for an instruction.

    Args:
        instruction: the robot's task, in plain words.
        rooms: the names of all rooms, if known.
        rules: sentences that every program must obey.
        skills: the skills that a program may call; examples that call other skills are omitted.

    Raises:
        UserError: the instruction is empty, or `rooms` is a string.
    """
    expect_list(rooms, "the rooms")
    instruction = clean_instruction(instruction)
    about_rooms = fill_template("rooms", rooms=", ".join(rooms)) if rooms else ""
    about_rules = fill_template("rules", rules=list_lines(rules)) if rules else ""
    wish = "\n\n".join(filter(None, (instruction, about_rooms, about_rules)))
    stubs = [stub(skill) for skill in skills.values()]
    shown = [example for example in examples() if example.skills <= skills.keys()]
    messages = [PromptMessage("system", fill_template("system", skills="\n\n".join(stubs)))]
    for example in shown:
        messages.append(PromptMessage("user", example.instruction))
        messages.append(PromptMessage("assistant", _fence(example.program)))
    messages.append(PromptMessage("user", wish))
    text = fill_template(
        "completion",
        skills="\n\n\n".join(stubs),
        examples="\n\n\n".join(
            fill_template("completion-example", instruction=e.instruction, program=e.program.rstrip())
            for e in shown
        ),
        instruction=_comment(instruction.strip()).removeprefix("# "),
        rooms="".join(_comment(about) + "\n" for about in (about_rooms, about_rules) if about),
        opening=OPENING,
    )
    return Prompt(instruction, tuple(messages), text + "\n", STOP_TEXTS, OPENING)


def stub(skill: Skill) -> str:
    """Return a skill as a Python stub for prompts. The stub of a custom skill includes an example call."""
    lines = [skill.doc.replace('"""', "'''")]
    if skill.fails:
        lines.append(f"Fails with an exception if {listed([when for _, when in skill.fails], 'or if')}.")
    if skill not in SKILLS.rows:
        result = "" if skill.returns.base is None else "result = "
        lines.append(f"Example: {result}{skill.call}")
    if len(lines) == 1:
        return f'def {skill.signature}:\n    """{lines[0]}"""'
    return f'def {skill.signature}:\n    """' + "\n\n    ".join(lines) + '\n    """'


@cache
def examples() -> tuple[Example, ...]:
    """Return the examples that prompts show, from the text files in the folder `examples`."""
    files = (path.read_text(encoding="utf-8") for path in sorted((PROMPT_FOLDER / "examples").glob("*.txt")))
    parts = (text.partition("\n\n") for text in files)
    return tuple(
        Example(instruction, program, frozenset(called_skills(parse_leniently(program))))
        for instruction, _, program in parts
    )


@cache
def template_hash(skills: SkillTable = SKILLS) -> str:
    """Return the SHA-256 hash, in hexadecimal, of everything in a prompt except the instruction."""
    plain = prompt_for("INSTRUCTION", skills=skills)
    with_rooms = prompt_for("INSTRUCTION", rooms=("ROOM", "OTHER ROOM"), skills=skills)
    shapes = [plain, with_rooms, plain.after("PROGRAM", ["PROBLEM", "OTHER PROBLEM"])]
    return hashlib.sha256(json.dumps([asdict(shape) for shape in shapes]).encode()).hexdigest()


@cache
def _template(name: str) -> Template:
    return Template((PROMPT_FOLDER / f"{name}.txt").read_text(encoding="utf-8"))


def fill_template(name: str, **values: str) -> str:
    """Return the text of the file `name`.txt in this folder, with its variables replaced by `values`."""
    return _template(name).substitute(values).rstrip("\n")


def list_lines(sentences: Sequence[str]) -> str:
    """Return a Markdown list with one sentence on each line."""
    return "\n".join(f"- {sentence}" for sentence in sentences)


def _fence(program: str) -> str:
    longest = max((len(run) for run in re.findall("`{3,}", program)), default=2)
    fence = "`" * (longest + 1)
    return f"{fence}python\n{program.strip(chr(10))}\n{fence}"


def _comment(text: str) -> str:
    return "\n".join(f"# {line}".rstrip() for line in text.splitlines())
