"""Decide whether a clause affirms something, denies it or leaves it open."""

from __future__ import annotations

import re
from enum import Enum

_WORDS = r"(?:[\w'\u2019]+\s+)"
_NOT = r"(?:not|never|cannot|cant|dont|doesnt|wont|isnt|\w+n['\u2019]t)"

# Phrases with a negative word that deny nothing; they are removed first.
_HARMLESS = re.compile(
    r"\bno (?:problem|worr(?:y|ies)|doubt|trouble|questions?|objections?|hurry|rush|matter|wonder|need)\b"
    r"|\b(?:no|not) (?:more|less|fewer|later|earlier|sooner|before|after)\b(?: than\b)?|\bnot (?:only|just)\b"
    r"|\bnot to (?:interrupt|disturb|bother)\b|\bnever ?mind\b|\bwhy not\b"
    r"|\bwithout (?:a )?(?:doubt|problems?|delay|hesitation|further ado)\b"
    rf"|\b{_NOT} (?:even )?(?:worry|mind|forget|hesitate|panic|get lost|be (?:late|afraid|shy))\b"
    r"|\b(?:can(?:no|['\u2019])t|can not) wait\b|\bcould(?:n['\u2019]t| not) be (?:happier|better)\b"
    rf"|\b{_NOT} miss\b|\bno shortage\b|\b(?:nobody|no ?one|nothing) else\b"
    # A double negative affirms.
    rf"|\b(?:no|nothing|nobody|no ?one|none|neither|nowhere|{_NOT})\s+{_WORDS}{{0,4}}"
    r"(?:lack\w*|miss(?:es|ing)|absent|alone|declin\w*|refus\w*|without)\b"
    r"|\b(?:lacking|missing|lacks?|without)\W{1,3}(?:nothing|none|no ?one|nobody)\b",
    re.IGNORECASE,
)
_DENIAL = re.compile(
    r"\b(?:no|not|none|nobody|nothing|noone|never|neither|nor|nowhere|without|cannot|cant|dont|doesnt|wont"
    r"|isnt|declin\w*|refus\w*|reject\w*|turn(?:s|ed|ing) (?:\w+ ){0,4}down|unable|unavailable|absent|missing"
    r"|lack\w*|in vain|negative|busy|alone|empty|other plans|(?:run|ran|is|are|was|were) out"
    r"|(?:is|are|was|were|all) (?:all )?gone|sold out"
    r"|(?:will|ha(?:s|ve) to) pass)\b"
    r"|['\u2019](?:s|re|m) out of\b"
    r"|n['\u2019]t\b",
    re.IGNORECASE,
)
_OPEN = re.compile(
    r"\b(?:maybe|perhaps|possibly|probably|presumably|might|whether|if|unless|unclear|unknown|uncertain|unsure"
    r"|undecided|almost|nearly|(?:guess|wonder)(?:es|s|ing)?|another time|next (?:time|week))\b"
    r"|\bmay\b(?! (?:i|we|your?|want|need)\b)|\bhop(?:e|es|ing)\b(?!.{0,60}\b(?:you|your|every\w+|all)\b)"
    rf"|\b{_NOT} (?:yet )?(?:be )?(?:know|knows|sure|certain|clear|decided?|told|tell)\b"
    r"|\bno (?:idea|answer)\b"
    # Announcements by the robot, and people who have not answered yet.
    r"|\bi(?:['\u2019]ll| will|(?:['\u2019]m| am) (?:going|about) to| (?:still )?(?:have|need) to)"
    r"(?: \w+){0,2}? (?:look|check|search|ask|find out|see whether)\b"
    r"|\b(?:needs?|has|have|wants?) to think\b|\b(?:wants?|wanted|would like) to know\b"
    # "I asked Alice": she has not answered yet.
    r"|\basked(?:\s+(?!said|declin|refus|accept|agree|is|are|will|has|have|had|does|did|would|want|lack|need)"
    r"\w+){1,4}\W*$",
    re.IGNORECASE,
)


class Polarity(Enum):
    """Whether a clause affirms something (`tea is there`), denies it (`no tea`) or neither (`maybe tea`)."""

    AFFIRMS = "affirms"
    DENIES = "denies"
    OPEN = "leaves open"


def polarity(clause: str) -> Polarity:
    """Return the polarity of a clause: `nobody` and `declined` deny; questions and `maybe` do neither."""
    if clause.rstrip().endswith("?") or _OPEN.search(clause):
        return Polarity.OPEN
    return Polarity.DENIES if denies_something(clause) else Polarity.AFFIRMS


def denies_something(clause: str) -> bool:
    """Whether a clause has a negative word outside phrases such as `no problem`."""
    return _DENIAL.search(without_harmless(clause)) is not None


def without_harmless(text: str) -> str:
    """Remove phrases such as `no problem`, which deny nothing."""
    return _HARMLESS.sub(" ", text)
