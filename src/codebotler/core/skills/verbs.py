"""English verbs for skills, in several forms."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

IRREGULAR_VERBS = """
    beat/beat bend/bent bind/bound blow/blew bring/brought build/built buy/bought catch/caught
    choose/chose come/came cut/cut dig/dug do/did draw/drew drive/drove feed/fed find/found fly/flew
    get/got give/gave go/went grind/ground hang/hung hear/heard hit/hit hold/held keep/kept lay/laid
    lead/led leave/left lend/lent let/let light/lit make/made meet/met put/put quit/quit read/read
    reset/reset ride/rode ring/rang run/ran say/said see/saw seek/sought send/sent set/set
    shake/shook show/showed shut/shut sit/sat speak/spoke spin/spun split/split stand/stood
    stick/stuck sweep/swept swing/swung take/took teach/taught tell/told throw/threw turn/turned
    wear/wore wind/wound write/wrote
"""
PAST: Mapping[str, str] = dict(re.findall(r"(\w+)/(\w+)", IRREGULAR_VERBS))
"""The past forms of irregular verbs that robots may need."""

STRESSED_AT_THE_END = frozenset(
    {
        *("begin", "commit", "control", "emit", "equip", "omit"),
        *("permit", "refer", "reset", "submit", "transfer", "unplug"),
    }
)
PARAMETER = re.compile(r"\{(\w+)\}")
PLAIN_REST = re.compile(r"([^{}]*?)(?:(?:^| )\{\w+\})?")  # after a verb: a particle and the only parameter


VerbForm: TypeAlias = Literal["base", "third", "past", "ing"]


@dataclass(frozen=True)
class Verb:
    """The English verb of a skill, such as `pick up`, in all forms that descriptions of events need."""

    base: str  # `pick up`
    third: str  # `picks up`
    past: str  # `picked up`
    ing: str  # `picking up`
    alone: str = ""  # `picked something up`, used when the object is not shown
    results: tuple[str, str] = ("no", "yes")  # the meanings of False and True
    object: str = ""  # `{} ml of {} into {}`, used for several texts

    def with_object(self, form: str, arguments: Sequence[str], quote: str = '"') -> str:
        """Add arguments to a verb form: `opened "door"`, or, if it has a template, `poured 5 ml into cup`."""
        if not self.object:
            return " ".join([form, *(f"{quote}{text}{quote}" for text in arguments)])
        missing = ["something"] * (self.object.count("{") - len(arguments))
        return f"{form} {self.object.format(*arguments, *missing)}"


def verb_of(template: str, parameters: Sequence[str], results: tuple[str, str], past: str = "") -> Verb:
    """Build a verb from a template such as `open {door}`.

    `results` are the words for False and True, such as `("no", "yes")`. `past` is the past form, such as
    `took`, if it is irregular.

    Raises:
        ValueError: the template has no verb, or braces around something other than a parameter.
    """
    head, _, rest = template.strip().partition(" ")
    head = head.lower()
    if not (head.isascii() and head.isalpha()):
        raise ValueError(f'the phrase "{template}" must begin with a verb, such as "open"')
    for name in PARAMETER.findall(template):
        if name not in parameters:
            raise ValueError(f'the phrase "{template}" names {{{name}}}, which is not a parameter')
    if set("{}") & set(PARAMETER.sub("", template)):
        raise ValueError(f'the phrase "{template}" may use braces only around parameters')
    forms = (head, _third(head), past or _past(head), _ing(head))
    plain = PLAIN_REST.fullmatch(rest)
    if plain is not None and len(parameters) <= 1:
        base, third, before, ing = (f"{form} {plain[1]}".strip() for form in forms)
        return Verb(base, third, before, ing, results=results)
    order = {name: str(number) for number, name in enumerate(parameters)}
    return Verb(*forms, results=results, object=PARAMETER.sub(lambda found: f"{{{order[found[1]]}}}", rest))


def _third(verb: str) -> str:
    if re.search(r"(?:s|x|z|ch|sh|o)$", verb):
        return f"{verb}es"
    return f"{verb[:-1]}ies" if re.search(r"[^aeiou]y$", verb) else f"{verb}s"


def _past(verb: str) -> str:
    if verb in PAST:
        return PAST[verb]
    if verb.endswith("e"):
        return f"{verb}d"
    return f"{verb[:-1]}ied" if re.search(r"[^aeiou]y$", verb) else f"{_doubled(verb)}ed"


def _ing(verb: str) -> str:
    if verb.endswith("ie"):
        return f"{verb[:-2]}ying"
    return f"{verb[:-1]}ing" if re.search(r"[^eoy]e$", verb) else f"{_doubled(verb)}ing"


def _doubled(verb: str) -> str:
    """Return the stem for `ed` and `ing`, with its consonant doubled after a short, stressed vowel."""
    is_short = re.fullmatch(r"(?:[^aeiou]*|.*qu)[aeiou][^aeiouwxy]", verb) is not None
    return verb + verb[-1] if is_short or verb in STRESSED_AT_THE_END else verb
