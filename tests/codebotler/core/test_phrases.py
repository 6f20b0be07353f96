import pytest

from codebotler.core.skills.verbs import VerbForm
from codebotler.core.text.phrases import NO_ANSWER, phrase
from codebotler.core.trace import Event, Option

TEA = Event("ask", "Tea?", (Option("yes"), Option("2", is_text=False)), answer="yes")


@pytest.mark.parametrize("form", ["base", "third", "past", "ing"])
@pytest.mark.parametrize(
    ("event", "parts"),
    [
        (Event("goto", "kitchen"), ["kitchen"]),
        (Event("pick", "mug"), ["up", "mug"]),
        (Event("check", "mug", found=False), ["mug", "not found"]),
        (Event("vote", "tea"), ["vote", "tea"]),
        (TEA, ["Tea?"]),
    ],
)
def test_a_phrase_names_texts_and_results_in_every_form(
    event: Event, parts: list[str], form: VerbForm
) -> None:
    assert [part for part in parts if part not in phrase(event, form)] == []
    assert (("yes" in phrase(event, form)) == (event is TEA)) or form == "third"


def test_question_lists_its_options_after_a_finite_verb() -> None:
    unanswered = Event("ask", "Tea?", TEA.options)
    forms: list[VerbForm] = ["base", "third", "past", "ing"]
    bracketed = [form for form in forms if "[yes | 2 (no text)]" in phrase(TEA, form)]
    assert bracketed == ["third", "past"]
    assert phrase(unanswered, "past").endswith(NO_ANSWER)
    assert NO_ANSWER not in phrase(unanswered, "third")


def test_caller_chooses_how_texts_are_shown_and_quoted() -> None:
    event = Event("pick", "mug")
    assert '"' not in phrase(event, "past", quote="")
    assert "MUG" in phrase(event, "past", show=str.upper)
    assert len(phrase(Event("say", "x" * 500), "past")) < 100


def test_text_cannot_close_its_own_quotation() -> None:
    forged = 'ok" → yes; picked up "mug'
    for event in (Event("say", forged), Event("ask", forged, TEA.options, answer=forged)):
        assert phrase(event, "past").count('"') == 2
