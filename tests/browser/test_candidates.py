"""The page asks which of several behaviours is meant, side by side, and takes the answer."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import expect

from pageserver import PageServer
from server import Request, Server
from viewing import DESK, PHONE, TABLET, OpenPage, Shoot, expect_no_grave_fault

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


def test_page_offers_a_card_for_each_behaviour(server: PageServer, open_page: OpenPage, shoot: Shoot) -> None:
    page = open_page(server)
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
    expect(page.get_by_role("button", name="Run it on the robot")).to_be_enabled()
    assert "Traceback" not in server.output
    expect(page.get_by_text("Checked: no problems.")).to_be_visible()
    expect(page.locator(".which")).to_be_hidden()
    text = server.call("GET", "/api/missions/current").data["program"]
    assert text.startswith("def task_program")


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
def test_a_recorded_model_offers_no_field_for_a_sentence(
    server: PageServer, open_page: OpenPage, shoot: Shoot, size: tuple[int, int]
) -> None:
    page = open_page(server, size=size, dark=True)
    ask(server)
    expect(page.locator(".which")).to_contain_text("A recorded model writes no new programs")
    expect(page.get_by_label("What should be different?")).to_have_count(0)
    expect_no_grave_fault(page)
    shoot(page, f"candidates-recorded-{size[0]}")
    other = open_page(server, "missions", size=size)
    expect(other.locator(".rows .state").first).to_have_text("waits for an answer")
    shoot(other, f"candidates-waits-{size[0]}")
    page.get_by_role("button", name="None of these").click()
    expect(page.locator(".headline")).to_have_text("Failed")
    expect(other.locator(".rows .state").first).to_have_text("failed")


def test_none_of_these_needs_a_sentence(tmp_path: Path, open_page: OpenPage) -> None:
    texts: dict[int, str] = {}  # By request, because the server may ask for the same answer twice.

    def answer(request: Request) -> str:
        text = texts.setdefault(id(request), f"There are {len(texts)} mugs")
        return f"```python\ndef task_program():\n    say('{text}')\n```\n"

    with Server(answer=answer) as model:
        settings = ("--model", "openai-chat:m", "--base-url", model.url, "--candidates", "2")
        with PageServer(tmp_path, *settings) as server:
            page = open_page(server)
            ask(server)
            page.get_by_role("button", name="None of these").click()
            expect(page.get_by_text("Say what should be different")).to_be_visible()
            assert server.call("GET", "/api/missions/current").data["phase"] == "question"
            page.get_by_label("What should be different?").fill("Speak Latin.")
            page.get_by_role("button", name="This one: option 1").click()
            expect(page.get_by_text("text can be added only")).to_be_visible()
            page.get_by_role("button", name="None of these").click()
            expect(page.locator(".which")).to_contain_text("second question")
            page.get_by_role("button", name="You decide").click()
            expect(page.get_by_text("Checked: no problems.")).to_be_visible()
            page.close()


def test_the_api_shows_the_question_and_takes_an_answer(server: PageServer, open_page: OpenPage) -> None:
    page = open_page(server)
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
