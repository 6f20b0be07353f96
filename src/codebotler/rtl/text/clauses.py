"""A text divided into sentences, and a sentence into clauses."""

from __future__ import annotations

import re
from collections.abc import Iterator

from codebotler.rtl.text.polarity import denies_something

_HALF_DAY = re.compile(r"(?<![^\W\d])([ap])\.\s?m\.?", re.IGNORECASE)  # a digit may touch it
_END = re.compile(r"(?<=\?)(?!\?)|[!;\n]+|\.(?!\d)")
_JOINT = re.compile(
    r",(?!\d)|(?<!\d),|\b(?:and|(?<!anything )but|while|whereas|however|although|though)\b", re.IGNORECASE
)
_FEW = r"(?:\w[\w']*+\W++){0,2}(?:\w[\w']*+\W*+)?"
_ITEM = re.compile(rf"\W*+(?:(?:in|at|(?:as )?for|from)\s+(?:\w[\w']*+\W++)?)?{_FEW}", re.IGNORECASE)
_PLACE = re.compile(r"\W*(?:in|at|(?:as )?for|from)\b", re.IGNORECASE)
_VERB = re.compile(
    r"\b(?:is|are|was|were|am|be|has|have|had|will|would|can|could|should|might|does|do|did|says?|said|wants?|yes"
    r"|accept\w*|agree\w*|join\w*|com(?:es?|ing)|lik(?:es?|ing)|needs?|buy|gave|gives?|please)\b|\w['\u2019](?:re|ll|ve|m|d)\b",
    re.IGNORECASE,
)
_TAG = re.compile(
    r",\s{0,3}(?:ok|okay|(?:all )?right|alright|yes|please|fine|got it|sounds good)\s{0,3}\?+\s*$",
    re.IGNORECASE,
)
_PROPOSES = re.compile(
    r"\W*(?:(?:how|what) about|(?:please )?(?:could|can|would|will) (?:you|we) (?:please )?"
    r"(?:set|turn|change|put|use|bring|buy|get))\b",
    re.IGNORECASE,
)
_ASIDE = re.compile(
    r",\s{1,3}(?:which|who|(?:I am|I['\u2019]m) (?:afraid|sorry)|unfortunately|sadly|luckily)\b"
    r"[^,;:\d]{0,60},",
    re.IGNORECASE,
)
_THERE = re.compile(r"\s*(?:there|it)\b", re.IGNORECASE)
_POSSESSES = r"(?:has|have|had|got|with|contains?)"
_HAS = re.compile(rf"\b{_POSSESSES}\b", re.IGNORECASE)
_NO_THING = re.compile(rf"\W*no\s+(?!{_POSSESSES}\b)\w+\W*", re.IGNORECASE)
_ASKED = re.compile(r"\basked\b", re.IGNORECASE)
_WHETHER = re.compile(r"\b(?:if|whether)\b", re.IGNORECASE)
_INVERTED = re.compile(
    r"\W*(?:is|are|was|were|am|did|does|do|will|would|can|could|has|have|had|should|shall|may|who|what|which|when"
    r"|where|why|how)\b",
    re.IGNORECASE,
)
_IN_VAIN = re.compile(r"\bwould\s+(?:like|love|have\s+(?:liked|loved))\s+to(?=\W{1,3}but\b)", re.IGNORECASE)
# A list ends where what is missing begins, which has no subject of its own.
_LIST = re.compile(
    r"(?:(?:,| and| or)\s{1,3}(?!(?:no|not|but|and|or)\b)\w[\w']*"
    r"(?: (?!(?:is|are|was|were|do|does|did|has|have|had|will|would|can|could|wants?|joins?|comes?)"
    r"\b)\w[\w']*)?){1,9}"
    r"(?=,?\s{1,3}(?:but|and)\s{1,3}(?:no|not|lacks?|(?:does|do|did|has|have|is|are)(?: not|n['\u2019]t))\b)",
    re.IGNORECASE,
)
_LISTED = re.compile(r",?\s{1,3}(?:and|or)\s{1,3}|,\s{1,3}", re.IGNORECASE)
_SUBJECT = re.compile(r"\s*(?:he|she|it|they|we|i|you|there)\b", re.IGNORECASE)


# "Butter? No." is one sentence.
_ANSWERED = re.compile(r"(?<![^.!?;\n] )\b(\w[\w' ]{0,30})\?\s+(yes|no|none)\b", re.IGNORECASE)
# "75 rather than 72" rejects 72.
_INSTEAD = re.compile(
    r"\b(?:rather than|instead of)\s+((?:(?!(?:and|but|is|are|was|were)\b)\w[\w'\u2019]*\s?){1,3})",
    re.IGNORECASE,
)
# "All rooms except room 3 have one": who is excepted has a clause of its own.
_EXCEPT = re.compile(
    r"\b(?P<of>all|every\w*|each|no(?:ne|body|thing| ?one)?)\b(?P<what>[^,.;:]{0,60}?)\W(?:"
    r"(?P<but>but)|except(?: for)?|with the exception of|apart from|other than|besides)\b\s*"
    r"(?P<whom>(?!(?:no|nobody|none|nothing|i|he|she|it|they|we|there)\b)(?:\w[\w']*\s+){0,3}?\w[\w']*)(?P<rest>\s+(?:is|are|was|were|has|have|had|will|would|can|wants?|gave|needs?|lacks?)\b.*|\W*)$",
    re.IGNORECASE,
)
# "I looked in room 2, but there was none": the second part tells of the room in the first.
_SEARCHED = re.compile(
    r"\b(?:look|search|check|hunt|visit|inspect)\w*\b|\bwas in\b|\b(?:is|was) done\b", re.IGNORECASE
)
_IN_VAIN_THERE = re.compile(
    r"\W*(?:but )?(?:(?:there (?:is|was|were)|i|we|it|you)\s+)?"
    r"(?:could ?n[o'\u2019]t|did ?n[o'\u2019]t|no|nothing|none)\b"
    r"(?!.*\b(?:rooms?|offices?|labs?)\b)",
    re.IGNORECASE,
)

# "2 people said yes to the question: do you like it?" asks nothing.
_QUOTED = re.compile(
    r"(\bto(?:(?: the question)?: ?| the question | (?=[\"'\u2018\u201c]))[\"'\u2018\u201c]?"
    r"(?:is|are|was|were|did|does|do|will|would|can|could|has|have|had|should|who|what|which|when|where|why|how)\b"
    r"[^?!;\n.]{0,120})\?",
    re.IGNORECASE,
)


def sentences(text: str) -> list[str]:
    """The sentences of a text, questions with their question marks; `4 p.m.` and `1.5` end none.

    Who asks and answers, as in `Butter? No`, says one sentence; a question that is answered asks nothing.
    """
    text = _QUOTED.sub(r"\1", _ANSWERED.sub(r"\1: \2", _HALF_DAY.sub(r"\1m", text)))
    return [part for part in _END.split(text) if part.strip().strip("?")]


def clauses(sentence: str, *, lists: bool = False) -> list[str]:
    """The clauses of a sentence, divided by commas and words such as `but`; those that ask end with `?`.

    With `lists`, a few words without a verb belong to the next full clause, or else to the one before:
    `Alice and Bob are in` is one clause.
    """
    sentence = _ASIDE.sub(" ", _TAG.sub("", sentence))
    if _PROPOSES.match(sentence):  # "How about 75 degrees?" is no question
        sentence = sentence.rstrip("? ")
    if lists:
        sentence = _with_whole_lists(sentence)
    rejected = [f"not {match[1]}" for match in _INSTEAD.finditer(sentence)]
    sentence = _with_exception(_INSTEAD.sub(" ", sentence))
    parts = _with_subjects([clause for part in _at_colon(sentence) for clause in _divided(part)])
    if sentence.rstrip().endswith("?"):
        parts = [f"{part}?" if _INVERTED.match(part) and part[-1] != "?" else part for part in parts]
    return [*(_gathered(_with_results(parts)) if lists else parts), *rejected]


def _with_whole_lists(sentence: str) -> str:
    """The sentence, in which `cheese and butter` is one item in `has cheese and butter but no bread`."""
    return _LIST.sub(lambda match: _LISTED.sub(" plus ", match[0]), sentence)


def _divided(sentence: str) -> list[str]:
    # "She would love to, but is busy" does not affirm.
    return [part for part in _JOINT.split(_IN_VAIN.sub("might", sentence)) if part.strip()]


def _with_exception(sentence: str) -> str:
    """The sentence, with a clause for who is excepted: `all come, not Bob` for `all but Bob come`."""
    match = _EXCEPT.search(sentence)
    if match is None or (match["but"] and _VERB.search(match["what"])):
        return sentence
    rule = f"{sentence[: match.start()]}{match['of']}{match['what']}{match['rest']}".rstrip(" .")
    excepted = f"{match['whom']} does" if denies_something(rule) else f"not {match['whom']}"
    return f"{rule}, {excepted}"


def _with_results(parts: list[str]) -> list[str]:
    """The parts, with what was not found behind where it was sought, as in `I looked, but found none`."""
    whole: list[str] = []
    for part in parts:
        if whole and _SEARCHED.search(whole[-1]) and _IN_VAIN_THERE.match(part):
            whole[-1] = f"{whole[-1]} {part}"
        else:
            whole.append(part)
    return whole


def _at_colon(sentence: str) -> list[str]:
    """Both sides of a colon if each is a clause: `You are not alone: Bob comes`, but not `Absent: Bob`."""
    head, colon, tail = sentence.partition(":")
    if colon and denies_something(head) and _VERB.search(_JOINT.split(tail)[0]):
        return [head, tail]
    return [sentence]


def _with_subjects(parts: list[str]) -> list[str]:
    """The parts, with the subject `room 3` before `no stapler` in `room 3 has paper, but no stapler`."""
    whole: list[str] = []
    for part in parts:
        lacks = bool(whole) and _NO_THING.fullmatch(part) and _HAS.search(whole[-1])
        whole.append(f"{_HAS.split(whole[-1])[0]}{part}" if lacks else part)
    return whole


def _gathered(parts: list[str]) -> Iterator[str]:
    waiting: list[str] = []
    done: list[str] = []
    for number, part in enumerate(parts, start=1):
        if _ASKED.search(part) and number < len(parts):  # what follows tells the answer
            waiting.append(_WHETHER.sub(" ", part))
            continue
        if _is_item(part):
            waiting.append(part)
            continue
        if waiting and part.endswith("?") and _INVERTED.match(part):
            done.append(" ".join(waiting))  # "Good day, how are you?" asks nothing of the day
            done.append(part)
        elif done and _SUBJECT.match(part) and not _belong(waiting, part):
            done[-1] = " ".join([done[-1], *waiting])  # the names before it belong to the clause before
            done.append(part)
        else:
            done.append(" ".join([*waiting, part]))
        waiting = []
    if done:
        done[-1] = " ".join([done[-1], *waiting])
    yield from done or [" ".join(waiting)]


def _belong(waiting: list[str], part: str) -> bool:
    """Whether the words before a clause with a subject belong to it: `in room 3, there is one`."""
    asked = any(map(_ASKED.search, waiting))
    return asked or (bool(waiting) and bool(_PLACE.match(waiting[-1])) and bool(_THERE.match(part)))


def _is_item(part: str) -> bool:
    """Whether a part is a few words that claim nothing by themselves, such as a name."""
    says_something = _SUBJECT.match(part) or _VERB.search(part) or denies_something(part)
    return _ITEM.fullmatch(part) is not None and not says_something
