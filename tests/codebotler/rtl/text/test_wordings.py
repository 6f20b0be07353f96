"""Sentences by somebody who did not know the rules: read as meant, or known to be read otherwise."""

import re
from pathlib import Path
from typing import Any

import yaml

from codebotler.rtl import Claim, Number
from codebotler.rtl.text.claims import minutes
from codebotler.rtl.text.times import times_in

WORDINGS: dict[str, list[dict[str, Any]]] = yaml.safe_load(
    (Path(__file__).parent / "wordings.yaml").read_text(encoding="utf-8")
)
OPPOSITE = {"affirms": "denies", "denies": "affirms", "open": "open"}


def test_claims_are_read_as_meant() -> None:
    for one in WORDINGS["claims"]:
        meant = OPPOSITE[one["reads"]] if "missing" in one["claim"] else one["reads"]
        expect(one, is_read=reading(one["message"], one["about"]) == meant)


def test_contrasts_are_read_as_meant() -> None:
    states = {"there": "affirms", "missing": "denies", "open": "open"}
    for one in WORDINGS["contrasts"]:
        meant = {about: states[state] for state in states for about in one.get(state, [])}
        read = {about: reading(one["message"], about) for about in meant}
        expect(one, is_read=read == meant)


def reading(message: str, about: str) -> str:
    """What a message says of something."""
    affirmed, denied = (Claim(re.escape(about), denied=which).matches(message) for which in (False, True))
    return "both" if affirmed and denied else "affirms" if affirmed else "denies" if denied else "open"


def test_numbers_are_read_as_meant() -> None:
    for one in WORDINGS["numbers"]:
        number = Number(0, re.escape(one["of"]), tuple(map(re.escape, one["others"])))
        meant = frozenset() if one["gives"] is None else frozenset({one["gives"]})
        expect(one, is_read=number.given(one["message"]) == meant)


def test_times_are_read_as_meant() -> None:
    for one in WORDINGS["times"]:
        named, meant = times_in(one["message"]), [minutes(time) for time in one["names"]]
        each_is_meant = all(any(time in readings for time in meant) for readings in named)
        each_is_named = all(any(time in readings for readings in named) for time in meant)
        expect(one, is_read=len(named) == len(meant) and each_is_meant and each_is_named)


def expect(one: dict[str, Any], *, is_read: bool) -> None:
    """A sentence is read as meant, or else says that it is not; the file tells how many are not."""
    assert is_read != one.get("misread", False), one


def test_few_are_read_otherwise() -> None:
    misread = {kind: sum("misread" in one for one in told) for kind, told in WORDINGS.items()}
    assert misread == {"claims": 21, "numbers": 14, "times": 2, "contrasts": 3}
    assert {kind: len(told) for kind, told in WORDINGS.items()} == {
        "claims": 150,
        "numbers": 100,
        "times": 50,
        "contrasts": 121,
    }
