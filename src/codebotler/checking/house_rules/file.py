"""Read files of house rules, and report mistakes in them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, TypeAlias

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from codebotler.checking.house_rules.rooms import unknown_rooms_in
from codebotler.core.skills.declaration import POSE_IN_ROOM
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.text.words import brief
from codebotler.core.world_file import Name, YamlText
from codebotler.core.yaml_files import YamlFile, YamlPath
from codebotler.rtl import And, EventPattern, Formula, RtlSyntaxError, holds, parse
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.rtl.reasoning.backtracking import slow_text
from codebotler.rtl.reasoning.sample_strings import patterns
from codebotler.rtl.syntax import SET_TAG, no_set
from codebotler.simulator.guard.house_rule import Rule, WhenJudged

EACH_TAG = "{each}"  # replaced in a formula by each name of `for_each`
MAX_QUOTED_CHARACTERS = 30  # a message quotes a formula from the error on


def _as_name(text: str) -> str:
    if not re.fullmatch("[a-z][a-z0-9-]*", text):
        raise ValueError("may contain only lower-case letters, digits and dashes, such as server-room")
    return text


def _as_set_name(text: str) -> str:
    if text == "each" or not SET_TAG.fullmatch(f"{{{text}}}"):
        raise ValueError('needs a letter, then letters, digits, spaces or underscores; "each" is reserved')
    return text


SetName = Annotated[YamlText, AfterValidator(_as_set_name)]
Sets: TypeAlias = Mapping[str, Sequence[str]]
"""The names in each set, by the name of the set, such as `labs: [lab 1, lab 2]` in a file."""


class HouseRuleFile(BaseModel):
    """An entry in a file of house rules: one rule with its sentence and its formula."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Annotated[str, Field(strict=True), AfterValidator(_as_name)]
    says: Annotated[YamlText, Field(min_length=1), AfterValidator(lambda text: " ".join(text.split()))]
    always: YamlText | None = None
    leaving: YamlText | None = None
    finally_: Annotated[YamlText | None, Field(alias="finally")] = None
    refuse: Annotated[bool, Field(strict=True)] = False
    any_: Annotated[bool, Field(alias="any", strict=True)] = False
    for_each: Annotated[list[Name] | Name | None, Field(min_length=1)] = None

    def rule(self, file: YamlFile, at: YamlPath, skills: SkillTable, sets: Sets) -> Rule:
        """Convert this entry, found at `at` in the file, to a rule. Raise UserError if it is not valid."""
        if len(self._texts) != 1:
            needed = 'exactly one of "always", "leaving" and "finally"; write one rule for each'
            raise file.wrong(f'the rule "{self.name}" needs {needed}', *at, *[*self._texts][-1:])
        ((when, text),) = self._texts.items()
        if when == "finally" and self.refuse:
            sentence = 'a "finally" rule cannot have "refuse"; remove "refuse" or write "always"'
            raise file.wrong(sentence, *at, "refuse")
        formula = self._formula(text, file, (*at, when), skills, sets)
        if when == "always" and not holds(formula, ()):
            sentence = f'the rule "{self.name}" is broken before anything has happened'
            mend = 'begin with a condition, as in: not tr.Last(goto(".*")) or ..., or write "finally"'
            raise file.wrong(f"{sentence}; {mend}", *at, "always")
        return Rule(self.name, self.says, formula, when, self.refuse, self.any_)

    @property
    def _texts(self) -> dict[WhenJudged, str]:
        """The formulas, of which there should be one."""
        texts: dict[WhenJudged, str | None] = {"always": self.always, "leaving": self.leaving}
        texts["finally"] = self.finally_
        return {when: text for when, text in texts.items() if text is not None}

    def with_single_names(
        self, file: YamlFile, at: YamlPath, skills: SkillTable, sets: Sets
    ) -> Iterator[Rule]:
        """For each name in the rule's sets, yield the rule for this name alone, to find unknown rooms."""
        (text,) = self._texts.values()
        for used in {tag[1] for tag in SET_TAG.finditer(text)} & {*sets}:
            yield from (self.rule(file, at, skills, {**sets, used: [name]}) for name in sets[used])

    def _formula(self, text: str, file: YamlFile, at: YamlPath, skills: SkillTable, sets: Sets) -> Formula:
        if self.for_each is not None and EACH_TAG not in text:
            raise file.wrong(f'the formula has no {EACH_TAG}; put it where "for_each" inserts names', *at)
        if self.for_each is None and EACH_TAG in text:
            raise file.wrong(f'{EACH_TAG} in a formula needs "for_each" with a list of names', *at)
        if isinstance(self.for_each, str):
            if self.for_each not in sets:
                sentence = f'"for_each" needs a list of names or a set; {no_set(self.for_each, sets)}'
                raise file.wrong(sentence, *at[:-1], "for_each")
            each = [{**sets, "each": [name]} for name in sets[self.for_each]]
            parts = [_parse(text, file, at, skills, one) for one in each]
        else:
            names = self.for_each or [EACH_TAG]
            parts = [_parse(text.replace(EACH_TAG, name), file, at, skills, sets) for name in names]
        return parts[0] if len(parts) == 1 else And(tuple(parts))


class HouseRulesFile(BaseModel):
    """The content of a file of house rules: named sets and rules."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    sets: Mapping[SetName, Annotated[list[Name], Field(min_length=1)]] = {}
    rules: Annotated[list[HouseRuleFile], Field(min_length=1)]


def read_rules(path: Path, skills: SkillTable = SKILLS, rooms: Sequence[str] = ()) -> tuple[Rule, ...]:
    """Read a file of house rules, and check that its rules name existing rooms.

    Args:
        path: the file.
        skills: the skills that its formulas may name.
        rooms: all rooms of the house; if this is empty, rules may name any room.

    Raises:
        UserError: the file is not valid; the message gives the line and the fix.
    """
    file = YamlFile.read(path)
    content = file.validate(HouseRulesFile)
    forms = content.rules
    names = [form.name for form in forms]
    for number, name in enumerate(names):
        if name in names[:number]:
            raise file.wrong(f'the rule "{name}" is listed twice; rename one', "rules", number, "name")
    sets = content.sets
    rules = tuple(form.rule(file, ("rules", number), skills, sets) for number, form in enumerate(forms))
    for number, (form, rule) in enumerate(zip(forms, rules, strict=True)):
        single = form.with_single_names(file, ("rules", number), skills, sets) if rooms else ()
        for one in (rule, *single):
            for sentence in unknown_rooms_in(one, rooms):
                raise file.wrong(sentence, "rules", number, rule.when)
    return rules


def _parse(text: str, file: YamlFile, at: YamlPath, skills: SkillTable, sets: Sets) -> Formula:
    try:
        formula = parse(text, skills=skills.with_skill(POSE_IN_ROOM), sets=sets)
    except RtlSyntaxError as error:
        there = brief(text[error.column - 1 :], MAX_QUOTED_CHARACTERS)
        where = f"column {error.column}" + (f", at {there}" if there else "")
        raise file.wrong(f"the formula is wrong in {where}: {error.problem}", *at) from None
    for element in elements(formula):
        for pattern in _regexes(element):
            if slow_text(pattern) is not None:
                sentence = f"searching a long text for {pattern!r} takes too much time"
                raise file.wrong(f"{sentence}; let no two repetitions match the same text", *at)
    return formula


def _regexes(element: EventPattern) -> Iterator[str]:
    texts = (element.text, element.options, element.answer, element.holding, element.to, *element.more)
    yield from (pattern for text in texts if text is not None for pattern in patterns(text))
    if element.place is not None:
        yield element.place
