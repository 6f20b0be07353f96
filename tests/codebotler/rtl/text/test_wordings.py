"""Sentences that somebody wrote who did not know the rules: so many are read as meant, and no fewer."""

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


def reading(message: str, about: str) -> str:
    """What a message says of something."""
    affirmed, denied = (Claim(re.escape(about), denied=which).matches(message) for which in (False, True))
    return "both" if affirmed and denied else "affirms" if affirmed else "denies" if denied else "open"


def test_claims_are_read_as_meant() -> None:
    told = WORDINGS["claims"]
    assert len(told) == 150
    meant = [OPPOSITE[one["reads"]] if "missing" in one["claim"] else one["reads"] for one in told]
    read = [reading(one["message"], one["about"]) for one in told]
    assert sum(one == other for one, other in zip(read, meant, strict=True)) >= 128


def test_numbers_are_read_as_meant() -> None:
    told = WORDINGS["numbers"]
    assert len(told) == 100
    read = [
        Number(0, re.escape(one["of"]), tuple(map(re.escape, one["others"]))).given(one["message"])
        for one in told
    ]
    meant = [frozenset() if one["gives"] is None else frozenset({one["gives"]}) for one in told]
    assert sum(one == other for one, other in zip(read, meant, strict=True)) >= 86


def test_times_are_read_as_meant() -> None:
    told = WORDINGS["times"]
    assert len(told) == 50
    read = 0
    for one in told:
        named, meant = times_in(one["message"]), [minutes(time) for time in one["names"]]
        each_is_meant = all(any(time in readings for time in meant) for readings in named)
        each_is_named = all(any(time in readings for readings in named) for time in meant)
        read += len(named) == len(meant) and each_is_meant and each_is_named
    assert read >= 48
