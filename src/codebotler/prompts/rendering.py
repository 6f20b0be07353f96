"""From an instruction to what a model is asked: chat messages, and one text that base models go on from."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from itertools import islice
from pathlib import Path
from string import Template
from typing import Literal, TypeAlias

from codebotler.core.errors import expect_list
from codebotler.core.program import TASK, parse
from codebotler.core.skills import SKILLS, Skill, SkillTable

Role: TypeAlias = Literal["system", "user", "assistant"]

FOLDER = Path(__file__).parent
OPENING = f"def {TASK}():\n"
MAX_LENGTH, MAX_TRIES = 100_000, 20  # of a reply, within which the end of its function is looked for
STOP = ("\ndef ", "\nclass ", "\n# Instruction", "\n```")  # four are as many as OpenAI's endpoint takes


@dataclass(frozen=True)
class Message:
    """One turn of a conversation with a chat model.

    Args:
        role: who says it.
        text: what is said.
    """

    role: Role
    text: str


@dataclass(frozen=True)
class Shown(Message):
    """A turn that shows a chat model a picture, too.

    Args:
        jpeg: the picture, as a JPEG file.
    """

    jpeg: bytes


@dataclass(frozen=True)
class Example:
    """An instruction and a program that does it, which show a model what is wanted."""

    instruction: str
    program: str


@dataclass(frozen=True)
class Prompt:
    """What a model is asked for, in the two ways of asking.

    Args:
        instruction: what the robot is to do.
        messages: for chat models.
        text: for base models, which go on from where it ends, with `opening`.
        stop: what base models stop in front of.
        opening: the beginning of the program that base models go on with.
    """

    instruction: str
    messages: tuple[Message, ...] = field(repr=False)
    text: str = field(repr=False)
    stop: tuple[str, ...]
    opening: str

    def after(self, program: str, problems: Sequence[str]) -> Prompt:
        """The request to write a program again, without its problems.

        Args:
            program: what the model wrote before.
            problems: what is wrong with it, each in a sentence.
        """
        listed = "\n".join(f"- {problem}" for problem in problems)
        answer = Message("assistant", _fenced(program))
        repair = Message("user", _filled("repair", problems=listed))
        text = _filled(
            "completion-repair", program=_comment(program), problems=_comment(listed), opening=self.opening
        )
        return replace(
            self,
            messages=(*self.messages, answer, repair),
            text=self.text.removesuffix(self.opening) + text + "\n",
        )

    def program_from(self, reply: str) -> str:
        """The program that a base model has written by going on from `text`, without what comes after it."""
        if re.match(rf"\s*(```|(async )?def {TASK}\b)", reply):
            return reply  # it has begun anew
        return self.opening + reply[: task_end(self.opening, reply, self.stop)]


def task_end(opening: str, reply: str, stop: Sequence[str] = STOP) -> int:
    """Where the function that a reply goes on with ends.

    It ends in front of a line that is not indented, unless that line belongs to a bracket or a text that is
    still open; where nothing but what comes later can tell, it does not.

    Args:
        opening: what the reply goes on from.
        reply: the text.
        stop: what ends it anyhow.
    """
    stops = [at for at in (reply.find(text) for text in stop) if at >= 0]
    end = min(stops, default=len(reply))
    for found in islice(re.finditer(r"\n(?=[^\s#)\]}])", reply[: min(end, MAX_LENGTH)]), MAX_TRIES):
        if _parses(opening + reply[: found.start()]):
            return found.start()
    return end


def prompt_for(instruction: str, *, rooms: Sequence[str] = (), skills: SkillTable = SKILLS) -> Prompt:
    """What to ask a model for an instruction.

    Args:
        instruction: what the robot is to do, in plain words.
        rooms: the names of all rooms, if they are known.
        skills: what a program may call.

    Raises:
        UserError: the rooms are a single text.
    """
    expect_list(rooms, "the rooms")
    about_rooms = _filled("rooms", rooms=", ".join(rooms)) if rooms else ""
    wish = "\n\n".join(filter(None, (instruction.strip(), about_rooms)))
    stubs = [_stub(skill) for skill in skills.values()]
    shown = examples()
    messages = [Message("system", _filled("system", skills="\n\n".join(stubs)))]
    for example in shown:
        messages.append(Message("user", _filled("instruction", instruction=example.instruction)))
        messages.append(Message("assistant", _fenced(example.program)))
    messages.append(Message("user", _filled("instruction", instruction=wish)))
    text = _filled(
        "completion",
        skills="\n\n\n".join(stubs),
        examples="\n\n\n".join(
            _filled("completion-example", instruction=e.instruction, program=e.program.rstrip())
            for e in shown
        ),
        instruction=_comment(instruction.strip()).removeprefix("# "),
        rooms=_comment(about_rooms) + "\n" if rooms else "",
        opening=OPENING,
    )
    return Prompt(instruction, tuple(messages), text + "\n", STOP, OPENING)


@cache
def examples() -> tuple[Example, ...]:
    """The programs that every prompt shows, in the order of their files."""
    return tuple(_examples())


@cache
def template_hash(skills: SkillTable = SKILLS) -> str:
    """The SHA-256, in hexadecimal, of all that shapes a prompt but the instruction.

    Args:
        skills: what a program may call.
    """
    plain = prompt_for("INSTRUCTION", skills=skills)
    with_rooms = prompt_for("INSTRUCTION", rooms=("ROOM", "OTHER ROOM"), skills=skills)
    shapes = [plain, with_rooms, plain.after("PROGRAM", ["PROBLEM", "OTHER PROBLEM"])]
    return hashlib.sha256(json.dumps([asdict(shape) for shape in shapes]).encode()).hexdigest()


def _examples() -> Iterator[Example]:
    for path in sorted((FOLDER / "examples").glob("*.txt")):
        instruction, _, program = path.read_text(encoding="utf-8").partition("\n\n")
        yield Example(instruction, program)


@cache
def _template(name: str) -> Template:
    return Template((FOLDER / f"{name}.txt").read_text(encoding="utf-8"))


def _filled(name: str, **values: str) -> str:
    return _template(name).substitute(values).rstrip("\n")


def _stub(skill: Skill) -> str:
    return f'def {skill.signature}:\n    """{skill.doc}"""'


def _fenced(program: str) -> str:
    longest = max((len(run) for run in re.findall("`{3,}", program)), default=2)
    fence = "`" * (longest + 1)
    return f"{fence}python\n{program.strip(chr(10))}\n{fence}"


def _comment(text: str) -> str:
    return "\n".join(f"# {line}".rstrip() for line in text.splitlines())


def _parses(source: str) -> bool:
    try:
        parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return False
    return True
