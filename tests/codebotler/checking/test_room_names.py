import pytest

from codebotler.checking.source.room_names import fixed_drives, lists_rooms, named_rooms
from codebotler.core.program import parse_leniently

START = "def task_program():\n    "


def rooms(*lines: str) -> tuple[str, ...]:
    return named_rooms(parse_leniently(START + "\n    ".join(lines) + "\n"))


@pytest.mark.parametrize(
    ("lines", "named"),
    [
        (['go_to("kitchen")', "go_to(location='lab')"], ("kitchen", "lab")),
        (['room = "kitchen"', "go_to(room)"], ("kitchen",)),
        (['room: str = "kitchen"', "go_to(room)"], ("kitchen",)),
        (['for room in ["lab", "hall"]:', "    go_to(room)"], ("lab", "hall")),
        (
            ['rooms = ["lab"]', 'rooms += ["hall"]', 'rooms.append("attic")', "go_to(rooms[0])"],
            ("lab", "hall", "attic"),
        ),
        (['for room in sorted({"lab": 1, "hall": 2}):', "    go_to(room)"], ("lab", "hall")),
        (['for room, who in {"lab": "ann"}.items():', "    go_to(room)"], ("lab",)),
        (['d = {"lab": "ann"}', "for room, who in d.items():", "    go_to(room)"], ("lab",)),
        (['for who, room in {"ann": "lab"}.items():', "    go_to(room)"], ("lab",)),
        (['for who, room in [("ann", "lab"), ("bob", "hall")]:', "    go_to(room)"], ("lab", "hall")),
        (['for n, room in enumerate(["lab"]):', "    go_to(room)"], ("lab",)),
        (['for who, room in zip(["ann"], ["lab"]):', "    go_to(room)"], ("lab",)),
        (['a, b = "lab", "hall"', "go_to(a if is_in_room('x') else b)"], ("lab", "hall")),
        (
            [
                "def visit(room, what):",
                "    go_to(room)",
                'visit("lab", "mug")',
                'visit(what="cup", room="hall")',
            ],
            ("lab", "hall"),
        ),
        (["for room in get_all_rooms():", '    if "office" in room:', "        go_to(room)"], ("office",)),
        (
            [
                "for room in get_all_rooms():",
                '    if room.lower().startswith("printer"):',
                "        go_to(room)",
            ],
            ("printer",),
        ),
        (['rooms = [r for r in get_all_rooms() if r != "hall"]'], ("hall",)),
        (['if get_current_location() == "hall":', "    pass"], ("hall",)),
        (['if "lab" in get_all_rooms():', "    pass"], ("lab",)),
        (['go_to("b")', 'go_to("a")', 'go_to("b")'], ("b", "a")),
        (['go_to([r for r in ["lab"] for r in [r, "hall"]][0])'], ("lab", "hall")),
        (['room = "lab"', "[go_to(r) for r in [room]]", "[r for r in [room, 'x']]"], ("lab",)),
    ],
)
def test_rooms_that_a_program_names_are_found(lines: list[str], named: tuple[str, ...]) -> None:
    assert rooms(*lines) == named


@pytest.mark.parametrize(
    "lines",
    [
        ['say("kitchen")'],
        ['answer = ask("ann", "tea?", ["yes"])', 'if answer == "yes":', "    go_to(place)"],
        ['for name in ["ann", "bob"]:', """    go_to(name + "'s office")"""],
        ["for i in range(3):", '    go_to(f"room {i}")'],
        ['go_to("1")'],
        ["for r in get_all_rooms():", "    go_to(r)", 'sum(r in ["jerky", "ham"] for r in ["jerky"])'],
        ["go_to(", "x"],
    ],
)
def test_texts_that_name_no_room_are_ignored(lines: list[str]) -> None:
    assert rooms(*lines) == ()


def test_at_most_a_hundred_rooms_of_a_program_are_found() -> None:
    assert len(rooms(*(f'go_to("room {number}")' for number in range(300)))) == 100


def test_deeply_nested_programs_have_no_rooms() -> None:
    assert named_rooms(parse_leniently(START + "go_to(" + "-" * 5_000 + "1)\n")) == ()
    assert fixed_drives(parse_leniently(START + "x = " + " + ".join(["a"] * 5_000) + "\n")) == []


def test_drives_to_literal_rooms_are_fixed() -> None:
    source = START + 'go_to("lab")\n    go_to(location="hall")\n    go_to(x)\n'
    assert fixed_drives(parse_leniently(source)) == [(2, "lab"), (3, "hall")]


@pytest.mark.parametrize(
    "source",
    [
        START + 'if "Lab" in get_all_rooms():\n        go_to("lab")\n',
        START + 'for room in get_all_rooms():\n        if room == "lab":\n            go_to("lab")\n',
        "def go_to(x):\n    pass\n" + START + 'go_to("lab")\n',
        "from mine import *\n" + START + 'go_to("lab")\n',
        START + 'go_to("lab"\n',
    ],
)
def test_conditional_or_redefined_drives_are_not_fixed(source: str) -> None:
    assert fixed_drives(parse_leniently(source)) == []


def test_lists_rooms_if_the_program_uses_get_all_rooms() -> None:
    assert lists_rooms(parse_leniently("rooms = get_all_rooms\n"))
    assert not lists_rooms(parse_leniently("rooms = ['get_all_rooms()']\n"))
    assert not lists_rooms(parse_leniently("get_all_rooms(\n"))
