"""The guide's page on perception agrees with the code."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import pytest
from PIL import Image

from codebotler.missions.storage import pictures as missionpictures
from codebotler.perception import Sighting, read_image
from codebotler.perception.base import MAX_LABEL_CHARACTERS
from codebotler.perception.image import ENCODINGS, LONGEST_SIDE, MAX_IMAGE_BYTES, MAX_PIXELS, MIN_SIDE
from codebotler.perception.open import DETECTOR_SETTINGS, MIN_SCORE
from server import Server

PAGE = (Path(__file__).parents[3] / "docs" / "perception.md").read_text()
TEXT = " ".join(PAGE.split())


def test_page_lists_the_fields_of_a_sighting() -> None:
    assert re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE) == [field.name for field in fields(Sighting)]


def test_example_looks_into_a_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Image.new("RGB", (64, 40)).save(tmp_path / "kitchen.jpg")
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    with Server(answer=lambda _: '{"found": true, "score": 0.9, "box": [0, 0, 0.5, 1]}') as server:
        exec(code.replace("http://localhost:8000/v1", server.url), {})
    assert capsys.readouterr().out == "Sighting(found=True, box=(0.0, 0.0, 0.5, 1.0), score=0.9)\n"
    assert read_image(tmp_path / "seen.jpg").size == (64, 40)


def test_page_names_the_limits_of_the_code() -> None:
    for sentence in (
        f"at most {MAX_IMAGE_BYTES // 10**6} MB and {MAX_PIXELS // 10**6} million pixels",
        f"at least {MIN_SIDE} pixels per side",
        f"at most {LONGEST_SIDE:,} pixels per side",
        f"at most {MAX_LABEL_CHARACTERS} characters",
        f"its score is at least {MIN_SCORE}.",
        f"temperature={DETECTOR_SETTINGS.temperature:g}, timeout={DETECTOR_SETTINGS.timeout:g}",
        f"Pictures of more than {missionpictures.MAX_STORED_PICTURE_BYTES // 10**6} MB",
        f"a total of {missionpictures.MAX_MISSION_PICTURE_BYTES // 10**6} MB per mission",
    ):
        assert sentence in TEXT, sentence
    listed = re.search(r"encodings? (`.*?)\. ", TEXT)
    assert listed is not None
    assert re.findall("`(.*?)`", listed[1]) == list(ENCODINGS)


def test_page_says_which_models_were_not_tested() -> None:
    assert "only with random weights" in TEXT
    assert "We did not test how well real models recognise objects" in TEXT
