"""The page asks which of several behaviours is meant, side by side, and takes the answer."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import expect

from pageserver import PageServer
from viewing import DESK, PHONE, TABLET, OpenPage, Shoot

INSTRUCTION = "See whether Ann wants tea."
SOLUTIONS = f"""
recorded:
  - instruction: {INSTRUCTION}
    careful:
      - about: says nothing of an empty room
        program: &quiet |
          def task_program():
              start = get_current_location()
              go_to("study")
              if is_in_room("ann"):
                  answer = ask("ann", "Tea?", ["yes", "no"])
                  go_to(start)
                  say("Ann says " + answer)
              else:
                  go_to(start)
      - about: tells that nobody is there
        program: |
          def task_program():
              start = get_current_location()
              go_to("study")
              if is_in_room("ann"):
                  answer = ask("ann", "Tea?", ["yes", "no"])
                  go_to(start)
                  say("Ann says " + answer)
              else:
                  go_to(start)
                  say("Ann is not in the study")
      - about: stays there
        program: |
          def task_program():
              go_to("study")
              if is_in_room("ann"):
                  ask("ann", "Tea?", ["yes", "no"])
    hasty: [{{about: as above, program: *quiet}}]
"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageServer]:
    folder = tmp_path_factory.mktemp("candidates")
    (folder / "model").mkdir()
    (folder / "model" / "tea.yaml").write_text(SOLUTIONS)
    model = ("--model", f"recorded:{folder / 'model'}", "--candidates", "6", "--speed", "100")
    with PageServer(folder, *model) as server:
        yield server


def ask(server: PageServer) -> None:
    server.call("POST", "/api/missions", {"instruction": INSTRUCTION})


def test_a_card_for_each_behaviour_and_one_answer(server: PageServer, opened: OpenPage, shoot: Shoot) -> None:
    page = opened(server)
    ask(server)
    cards = page.locator(".which .card")
    expect(cards).to_have_count(3)
    for width, height in (DESK, TABLET, PHONE):
        page.set_viewport_size({"width": width, "height": height})
        for card in cards.all():
            box = card.bounding_box()
            assert box is not None
            assert 0 <= box["x"] <= box["x"] + box["width"] <= width
        shoot(page, f"candidates-{width}")
    page.set_viewport_size({"width": DESK[0], "height": DESK[1]})
    page.get_by_role("button", name="This one: option 2").click()
    expect(page.get_by_text("Checked: no problems.")).to_be_visible()
    expect(page.locator(".which")).to_be_hidden()
    text = server.call("GET", "/api/missions/current").data["program"]
    assert text.startswith("def task_program")


def test_none_of_these_needs_a_sentence(server: PageServer, opened: OpenPage) -> None:
    page = opened(server)
    ask(server)
    page.get_by_role("button", name="None of these").click()
    expect(page.get_by_text("Say what should be different")).to_be_visible()
    assert server.call("GET", "/api/missions/current").data["phase"] == "question"
    page.get_by_role("button", name="You decide").click()
    expect(page.get_by_text("Checked: no problems.")).to_be_visible()


def test_the_api_shows_the_question_and_takes_an_answer(server: PageServer, opened: OpenPage) -> None:
    page = opened(server)
    ask(server)
    expect(page.locator(".which .card")).to_have_count(3)
    question = server.call("GET", "/api/missions/current").data["question"]
    assert [option["size"] for option in question["options"]] == [2, 2, 2]
    path = "/api/missions/current/answer"
    assert server.call("POST", path, {"answer": 4}).status == 409
    assert server.call("POST", path, {"answer": 0}).status == 422
    assert server.call("POST", path, {"answer": 3}).status == 202
    expect(page.get_by_text("Checked: no problems.")).to_be_visible()
    assert server.call("GET", "/api/missions/current").data["program"] == question["options"][2]["program"]
