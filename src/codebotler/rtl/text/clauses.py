"""Split texts into sentences, and sentences into clauses."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

from codebotler.rtl.text.polarity import denies_something

_HALF_DAY = re.compile(r"(?<![^\W\d])([ap])\.\s?m\.?", re.IGNORECASE)  # a digit may come directly before it
_END = re.compile(r"(?<=\?)(?!\?)|[!;\n]+|\.(?!\d)")
_JOINT = re.compile(
    r"(,(?!\d)|(?<!\d),|\b(?:and|(?<!anything )but|while|whereas|however|although|though)\b"
    r"|(?<=, )(?:only|yet(?! to\b)|except(?=[^,]{0,40}\b(?:is|are|was|were|has|have)\b))\b)",
    re.IGNORECASE,
)
_DASH = re.compile(r"(?<=[^\W\d]) [-\u2013\u2014] ")
_FEW = r"(?:\w[\w']*+\W++){0,2}(?:\w[\w']*+\W*+)?"
_ITEM = re.compile(rf"\W*+(?:(?:in|at|(?:as )?for|from)\s+(?:\w[\w']*+\W++)?)?{_FEW}", re.IGNORECASE)
_PLACE = re.compile(r"\W*(?:in|at|(?:as )?for|from)\b", re.IGNORECASE)
_VERB = re.compile(
    r"\b(?:is|are|was|were|am|be|has|have|had|will|would|can|could|should|might|does|do|did|says?|said|wants?|yes"
    r"|accept\w*|agree\w*|join\w*|com(?:es?|ing)|lik(?:es?|ing)|needs?|buy|gave|gives?|please)\b|\w['\u2019](?:re|ll|ve|m|d|t)\b",
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
    r"[^,;:\d]{0,60},"
    r"|,?\s{1,3}(?:however|though)\b,?(?=\s{1,3}(?:is|are|was|were|has|have|had|does|did|do|will|would|can"
    r"|could|declin|refus|accept|agree|lack|said|says|wants?)(?:\b|ed|es?|s|n['\u2019]t))",
    re.IGNORECASE,
)
_THERE = re.compile(r"\s*(?:there|it)\b", re.IGNORECASE)
_THERE_IS = re.compile(r"\bthere(?: is| are| was| were|['\u2019]s)\b", re.IGNORECASE)
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
_SUBJECT = re.compile(r"\s*(?:he|she|it|they|we|i|you|there)\b", re.IGNORECASE)
_NO_SUBJECT = re.compile(
    r"\s*(?:(?:no|not|neither) \w|(?:lacks?|is|are|was|were|does|do|did|has|have|had)(?:\b|n['\u2019]t))",
    re.IGNORECASE,
)
_SINGULAR = re.compile(r"\b(?:(is|was|has|does)|are|were|have|do)(?:\b|n['\u2019]t)", re.IGNORECASE)
# A clause that ends with one of these words is not a list: `Bob is in`, `butter is missing`.
_STATES = r"(?:there|here|in|out|gone|(?:un)?available|absent|yes|no|not|too|\w+(?:ed|ing))\b"
_STATE_LENGTH = 40  # characters at the end of a clause that are searched for these words
_STATE = re.compile(rf"\b{_STATES}\W*$", re.IGNORECASE)
_LACK = re.compile(r"\b(?:missing|lacking|absent|unavailable|gone)\b", re.IGNORECASE)
_UNFINISHED = re.compile(
    r"\b(?:is|are|was|were)(?: not|n['\u2019]t)?\W*$"
    rf"|^\W*(?:so|neither|nor) (?:is|are|was|were)\b|^\W*not (?!{_STATES})",
    re.IGNORECASE,
)

# "Butter? No." is one sentence.
_ANSWERED = re.compile(r"(?<![^.!?;\n] )\b(\w[\w' ]{0,30})\?\s+(yes|no|none)\b", re.IGNORECASE)
# "75 rather than 72" rejects 72.
_INSTEAD = re.compile(
    r"\b(?:rather than|instead of)\s+((?:(?!(?:and|but|is|are|was|were)\b)\w[\w'\u2019]*\s?){1,3})",
    re.IGNORECASE,
)
# "All rooms except room 3 have one": the exception becomes a clause of its own.
_EXCEPT = re.compile(
    r"\b(?P<of>all|every\w*|each|no(?:ne|body|thing| ?one)?)\b(?P<what>[^,.;:]{0,60}?)\W(?:"
    r"(?P<but>but)|except(?: for)?|with the exception of|apart from|other than|besides)\b\s*"
    r"(?P<whom>(?!(?:no|nobody|none|nothing|i|he|she|it|they|we|there)\b)(?:\w[\w']*\s+){0,3}?\w[\w']*)(?P<rest>\s+(?:is|are|was|were|has|have|had|will|would|can|wants?|gave|needs?|lacks?)\b.*|\W*)$",
    re.IGNORECASE,
)
# "I looked in room 2, but there was none": the second part is about the room in the first.
_SEARCHED = re.compile(
    r"\b(?:look|search|check|hunt|visit|inspect)\w*\b|\bwas in\b|\b(?:is|was) done\b", re.IGNORECASE
)
_IN_VAIN_THERE = re.compile(
    r"\W*(?:but )?(?:(?:there (?:is|was|were)|i|we|it|you)\s+)?(?:found\s+)?"
    r"(?:could ?n[o'\u2019]t|did ?n[o'\u2019]t|no|nothing|none)\b"
    r"(?!.*\b(?:rooms?|offices?|labs?)\b)",
    re.IGNORECASE,
)

# "2 people said yes to the question: do you like it?" is not a question.
_QUOTED = re.compile(
    r"(\bto(?:(?: the question)?: ?| the question | (?=[\"'\u2018\u201c]))[\"'\u2018\u201c]?"
    r"(?:is|are|was|were|did|does|do|will|would|can|could|has|have|had|should|who|what|which|when|where|why|how)\b"
    r"[^?!;\n.]{0,120})\?",
    re.IGNORECASE,
)


def sentences(text: str) -> list[str]:
    """Split a string into sentences, where questions keep their question marks.

    Neither `4 p.m.` nor `1.5` ends a sentence. A question together with its answer, as in `Butter? No`,
    is one sentence that is not a question.
    """
    text = _QUOTED.sub(r"\1", _ANSWERED.sub(r"\1: \2", _HALF_DAY.sub(r"\1m", text)))
    return [part for part in _END.split(text) if part.strip().strip("?")]


class _Part(NamedTuple):
    joint: str  # the comma or word before the part, in lower case
    text: str


def clauses(sentence: str, *, lists: bool = False) -> list[str]:
    """Split a sentence at commas and words such as `but`, where questions keep their `?`.

    With `lists`, a few words without a verb are added to the full clause before or after them:
    `Alice and Bob are in` is one clause, and `he has bread and butter, but cheese is missing` is two.
    """
    sentence = _ASIDE.sub(" ", _TAG.sub("", sentence))
    if _PROPOSES.match(sentence):  # "How about 75 degrees?" is not a question
        sentence = sentence.rstrip("? ")
    if lists and not sentence.rstrip().endswith("?"):
        sentence = _DASH.sub(", ", sentence)
    rejected = [f"not {match[1]}" for match in _INSTEAD.finditer(sentence)]
    sentence = _split_exception(_INSTEAD.sub(" ", sentence))
    parts = [part for half in _split_at_colon(sentence) for part in _split_at_joints(half)]
    if sentence.rstrip().endswith("?"):
        parts = [
            part._replace(text=f"{part.text}?")
            if _INVERTED.match(part.text) and part.text[-1] != "?"
            else part
            for part in parts
        ]
    whole = _join_results(_join_lists(parts)) if lists else [part.text for part in parts]
    return [*_add_subjects(whole), *rejected]


def complete_clauses(parts: Iterable[str]) -> Iterator[str]:
    """Yield clauses with omitted words restored, such as `it is not missing` for `it is not`."""
    names_lack = False
    for part in parts:
        is_unfinished = names_lack and _UNFINISHED.search(part) is not None
        yield f"{part} missing" if is_unfinished else part
        names_lack = is_unfinished or _LACK.search(part) is not None


def _split_at_joints(sentence: str) -> Iterator[_Part]:
    joint = ""
    # "She would love to, but is busy" does not affirm.
    for at, piece in enumerate(_JOINT.split(_IN_VAIN.sub("might", sentence))):
        if at % 2:
            joint = piece.lower() if joint in ("", ",") else joint  # ", but" counts as "but"
        elif piece.strip():
            yield _Part(joint, piece)
            joint = ""


def _split_exception(sentence: str) -> str:
    """Turn an exception into a clause of its own: `all come, without Bob` for `all but Bob come`."""
    match = _EXCEPT.search(sentence)
    if match is None:
        return sentence
    if match["but"] and _VERB.search(match["what"]) and not _is_item(match["whom"] + match["rest"]):
        return sentence
    rule = f"{sentence[: match.start()]}{match['of']}{match['what']}{match['rest']}".rstrip(" .")
    excepted = f"{match['whom']} does" if denies_something(rule) else f"without {match['whom']}"
    return f"{rule}, {excepted}"


def _join_results(parts: Iterable[str]) -> list[str]:
    """Join each search with its negative result, as in `I looked, but found none`."""
    whole: list[str] = []
    for part in parts:
        if whole and _SEARCHED.search(whole[-1]) and _IN_VAIN_THERE.match(part):
            whole[-1] = f"{whole[-1]} {part}"
        else:
            whole.append(part)
    return whole


def _split_at_colon(sentence: str) -> list[str]:
    """Split at a colon between clauses: `You are not alone: Bob comes`, but not `Absent: Bob`."""
    head, colon, tail = sentence.partition(":")
    if colon and denies_something(head) and _VERB.search(_JOINT.split(tail)[0]):
        return [head, tail]
    return [sentence]


def _add_subjects(parts: Iterable[str]) -> list[str]:
    """Add the subject `room 3` before `no stapler` in `room 3 has paper, but no stapler`."""
    whole: list[str] = []
    for part in parts:
        lacks = bool(whole) and _NO_THING.fullmatch(part) and _HAS.search(whole[-1])
        whole.append(f"{_HAS.split(whole[-1])[0]}{part}" if lacks else part)
    return whole


def _join_lists(parts: Sequence[_Part]) -> Iterator[str]:
    waiting: list[_Part] = []
    done: list[str] = []
    for number, part in enumerate(parts, start=1):
        if _ASKED.search(part.text) and number < len(parts):  # the answer follows
            waiting.append(_Part(part.joint, _WHETHER.sub(" ", part.text)))
            continue
        if _is_item(part.text):
            waiting.append(part)
            continue
        names = [name.text for name in waiting]
        if waiting and part.text.endswith("?") and _INVERTED.match(part.text):
            done.append(" ".join(names))  # as in "Good day, how are you?"
            done.append(part.text)
        else:
            end = _find_end_of_list(done, waiting, part)
            if end:
                done[-1:] = [" ".join([*done[-1:], *names[:end]])]
            done.append(" ".join([*names[end:], part.text]))
        waiting = []
    names = [name.text for name in waiting]
    if done:
        done[-1] = " ".join([done[-1], *names])
    yield from done or [" ".join(names)]


def _find_end_of_list(done: Sequence[str], waiting: Sequence[_Part], part: _Part) -> int:
    """Count the names that belong to the previous clause or form a clause of their own.

    A list ends at a contrast, or if the next clause cannot begin with it. Otherwise, a list at the end of the
    previous clause ends after `and` and one more name, as in `he has tea and milk, sugar is missing`.
    """
    if not waiting or _belongs_to_next(waiting, part.text):
        return 0
    joints = [name.joint for name in (*waiting, part)]
    contrasts = [at for at, joint in enumerate(joints) if at and joint not in (",", "and")]
    if contrasts and (done or not (_PLACE.match(waiting[0].text) or joints[-1] in ("however", "though"))):
        return contrasts[-1]
    if done and joints[0] not in (",", "and"):  # names after a contrast do not belong to the previous clause
        return 0
    may_list = bool(done) and _STATE.search(done[-1][-_STATE_LENGTH:]) is None
    has_no_subject = _NO_SUBJECT.match(part.text) is not None and (may_list or joints[-1] == "and")
    if done and (has_no_subject or _SUBJECT.match(part.text)):
        return len(waiting)
    ends = [at for at, pair in enumerate(pairwise(joints), start=1) if pair == ("and", ",")]
    verb = _SINGULAR.search(part.text)
    if joints[-1] == "and" and verb and verb[1]:  # "tea and milk and sugar is missing"
        ends.append(ends[-1] if ends else len(waiting))
    return ends[-1] if may_list and ends else 0


def _belongs_to_next(waiting: Sequence[_Part], part: str) -> bool:
    """Whether the words before a clause belong to it, as in `in room 3, there is one`."""
    if any(_ASKED.search(name.text) for name in waiting):
        return True
    is_place_after = bool(_PLACE.match(waiting[-1].text)) and bool(_THERE.match(part))
    return is_place_after or (bool(_PLACE.match(waiting[0].text)) and bool(_THERE_IS.search(part)))


def _is_item(part: str) -> bool:
    """Whether a part consists of a few words that make no claim, such as a name."""
    says_something = _SUBJECT.match(part) or _VERB.search(part) or denies_something(part)
    return _ITEM.fullmatch(part) is not None and not says_something
