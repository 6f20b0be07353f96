"""Describe contracts in words: a sentence or two for people, and a row per skill for tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from codebotler.core.skills.kinds import ASK, GOTO, PICK, PLACE, SAY
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill, SkillTable
from codebotler.core.text.phrases import verb
from codebotler.core.text.words import brief_part, counted, elide_list, listed
from codebotler.simulator.guard.contract import TELLING_SKILLS, Contract, SkillBound, is_goal

NEVER = {
    GOTO: "drives nowhere",
    PICK: "picks up nothing",
    PLACE: "puts down nothing",
    ASK: "asks nobody",
    SAY: "says nothing",
}
"""Words for a program whose contract lacks a skill, by the kind of event that the skill records."""

ANYBODY = "anybody"  # a question to "" may be answered by any person in the room
GAP = "[...]"
MAX_VALUES, MAX_LONG_TEXTS = 6, 3  # shown texts in a short sentence
LONG_TEXT = 30  # characters


def contract_rows(
    contract: Contract, skills: SkillTable, show: Callable[[str], str] = brief_part, *, is_short: bool = False
) -> Iterator[tuple[str, str, str]]:
    """Yield each skill's verb, objects and limit, as ("pick up", '"mug" in "office"', "at most 2 times").

    If `is_short`, long lists end with a number, such as "or 4 more". `show` shortens a single text.
    """
    named = contract.skills.keys() - TELLING_SKILLS
    for row in sorted((row for row in skills.rows if row.name in named), key=lambda row: not row.is_drive):
        bound = contract.skills[row.name]
        what = row.name if row.recording is None else verb(row.recording.kind).base
        places = f"in {_any_of(map(show, bound.places), is_short=is_short)}" if bound.places else ""
        often = "" if not bound.at_most else f"at most {counted(bound.at_most, 'time')}"
        texts = _texts_of(row, bound, show, is_short=is_short)
        yield what, f"{texts} {places}".strip(), often


def contract_sentence(
    contract: Contract, skills: SkillTable, show: Callable[[str], str] = brief_part, *, is_short: bool = True
) -> str:
    """Return a contract in a sentence or two: what the program may do and, without custom skills, never does.

    If `is_short`, long lists end with a number, such as "or 4 more". `show` shortens a single text.
    """
    rows = contract_rows(contract, skills, show, is_short=is_short)
    may = [f"{what} {allowed}".strip() for what, allowed, _ in rows]
    known = {row.recording.kind: row.name for row in skills.rows if row.recording is not None}
    never = [what for kind, what in NEVER.items() if known.get(kind, "") not in {"", *contract.skills}]
    if any(name not in SKILLS and not skills[name].is_idle for name in contract.skills):  # it may do these
        never = []
    parts = [f"It may {'; '.join(may)}" if may else "", f"It {listed(never)}" if never else ""]
    return " ".join(f"{part}." for part in parts if part)


def _texts_of(row: Skill, bound: SkillBound, show: Callable[[str], str], *, is_short: bool) -> str:
    words = []
    for (name, templates), parameter in zip(bound.texts, row.parameters, strict=True):
        if any(one.is_any for one in templates):
            words.append("any room" if is_goal(row, name) else f"any {name.replace('_', ' ')}")
        elif templates:
            first = sorted(templates, key=lambda one: len(one.parts) == 1)  # those with gaps
            empty = ANYBODY if row.recording is not None and row.recording.to == name else '""'
            any_of = _any_of((GAP.join(map(show, one.parts)) for one in first), empty, is_short=is_short)
            words.append(f"with {any_of}" if parameter.is_options else any_of)
    return " ".join(words)


def _any_of(texts: Iterable[str], empty: str = '""', *, is_short: bool) -> str:
    shown = ['"{}"'.format(text.replace('"', "'")) if text else empty for text in texts]
    few = MAX_LONG_TEXTS if any(len(text) > LONG_TEXT for text in shown) else MAX_VALUES
    return listed(elide_list(shown, few) if is_short else shown, "or")
