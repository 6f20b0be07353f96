"""Sentences by an author who did not know the rules are read as meant, or listed as misread."""

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
        assert_read(one, is_read=read_claim(one["message"], one["about"]) == meant)


def test_contrasts_are_read_as_meant() -> None:
    states = {"there": "affirms", "missing": "denies", "open": "open"}
    for one in WORDINGS["contrasts"]:
        meant = {about: states[state] for state in states for about in one.get(state, [])}
        read = {about: read_claim(one["message"], about) for about in meant}
        assert_read(one, is_read=read == meant)


def read_claim(message: str, about: str) -> str:
    """Return whether a message affirms or denies something, leaves it open, or does both."""
    affirmed, denied = (Claim(re.escape(about), denied=which).matches(message) for which in (False, True))
    return "both" if affirmed and denied else "affirms" if affirmed else "denies" if denied else "open"


def test_numbers_are_read_as_meant() -> None:
    for one in WORDINGS["numbers"]:
        number = Number(0, re.escape(one["of"]), tuple(map(re.escape, one["others"])))
        meant = frozenset() if one["gives"] is None else frozenset({one["gives"]})
        assert_read(one, is_read=number.given(one["message"]) == meant)


def test_times_are_read_as_meant() -> None:
    for one in WORDINGS["times"]:
        named, meant = times_in(one["message"]), [minutes(time) for time in one["names"]]
        each_is_meant = all(any(time in readings for time in meant) for readings in named)
        each_is_named = all(any(time in readings for readings in named) for time in meant)
        assert_read(one, is_read=len(named) == len(meant) and each_is_meant and each_is_named)


def assert_read(one: dict[str, Any], *, is_read: bool) -> None:
    """Fail unless a sentence is read as meant, or is listed as misread and still is."""
    assert is_read != one.get("misread", False), one


def test_few_sentences_are_misread() -> None:
    misread = {kind: sum("misread" in one for one in rows) for kind, rows in WORDINGS.items()}
    assert misread == {"claims": 21, "numbers": 14, "times": 2, "contrasts": 3}
    assert {kind: len(rows) for kind, rows in WORDINGS.items()} == {
        "claims": 150,
        "numbers": 100,
        "times": 50,
        "contrasts": 121,
    }
