"""Files of house rules: how they are read, their mistakes, and checks of programs against them."""

from pathlib import Path

import pytest

from codebotler.checking.check import check
from codebotler.checking.house_rules.file import read_rules
from codebotler.core.errors import UserError

RULES = r"""
rules:
  - name: server-room
    says: Never go into the server room.
    always: not tr.Exists(goto(r"\bserver room\b"))
  - name: knock
    says: Knock before you enter an office.
    always: >-
      not tr.Last(goto("office"))
      or tr.BeforeLast(goto("office")).AfterLast(goto(".*")).Exists(say("knock"))
  - name: report
    says: At the end, tell the start location what came of it.
    finally: tr.AfterLast(goto(without("start_loc"))).Exists(at("start_loc", say(".+")))
"""
ROOMS = ["start_loc", "kitchen", "server room", "alice's office"]
ATTIC = 'not tr.Exists(goto("attic"))'
TWICE = f"  - name: a\n    says: b\n    always: '{ATTIC}'\n"


def write_rules(folder: Path, text: str = RULES) -> Path:
    path = folder / "rules.yaml"
    path.write_text(text)
    return path


def test_rules_are_read_in_order(tmp_path: Path) -> None:
    rules = read_rules(write_rules(tmp_path))
    assert [(rule.name, rule.when, rule.refuse) for rule in rules] == [
        ("server-room", "always", False),
        ("knock", "always", False),
        ("report", "finally", False),
    ]
    assert rules[0].says == "Never go into the server room."
    (refusing,) = read_rules(
        write_rules(tmp_path, f"rules: [{{name: a, says: b, always: '{ATTIC}', refuse: true}}]")
    )
    assert refusing.refuse


def test_sentence_on_several_lines_becomes_one_line(tmp_path: Path) -> None:
    text = f"rules:\n  - name: a\n    says: |\n      Stay\n      out.\n    always: '{ATTIC}'\n"
    assert [rule.says for rule in read_rules(write_rules(tmp_path, text))] == ["Stay out."]


EACH_ROOM = """
rules:
  - name: two-questions
    says: Ask at most two questions in each room.
    for_each: [kitchen, alice's office]
    always: not tr.AtLeast(at("{each}", mention(".*")), 3)
"""


def test_for_each_applies_one_rule_to_each_room(tmp_path: Path) -> None:
    (rule,) = read_rules(write_rules(tmp_path, EACH_ROOM))
    assert str(rule.formula) == (
        'not tr.AtLeast(at("kitchen", mention(".*")), 3) and '
        'not tr.AtLeast(at("alice\'s office", mention(".*")), 3)'
    )
    (alone,) = read_rules(write_rules(tmp_path, EACH_ROOM.replace("[kitchen, alice's office]", "[kitchen]")))
    assert str(alone.formula) == 'not tr.AtLeast(at("kitchen", mention(".*")), 3)'
    program = "def task_program():\n" + "".join(
        f"    go_to({room!r})\n" + "    ask('', 'Tea?', ['yes', 'no'])\n" * number
        for room, number in (("kitchen", 2), ("alice's office", 3))
    )
    found = check(program, rooms=ROOMS, house_rules=read_rules(write_rules(tmp_path, EACH_ROOM)))
    assert [problem.line for problem in found.problems] == [8]


SETS = """
sets:
  metal: [fork, "pan (old)"]
  wet rooms: [bathroom, alice's shower]
rules:
  - name: a
    says: Keep it.
    always: not tr.Exists({})
"""


@pytest.mark.parametrize(
    ("element", "expanded"),
    [
        ('pick("{metal}")', r'pick(r"fork|pan \(old\)")'),
        (r'pick(r"^{metal}\b")', r'pick(r"^(?:fork|pan \(old\))\b")'),
        ('at("{wet rooms}", say(".*"))', 'at("bathroom|alice\'s shower", say(".*"))'),
        ("goto(without('{wet rooms}'))", 'goto(without("bathroom|alice\'s shower"))'),
        ('say(words("{metal}", "x{2}"))', r'say(words(r"fork|pan \(old\)", "x{2}"))'),
    ],
)
def test_set_matches_any_of_its_names(tmp_path: Path, element: str, expanded: str) -> None:
    (rule,) = read_rules(write_rules(tmp_path, SETS.replace("{}", element)))
    assert str(rule.formula) == f"not tr.Exists({expanded})"


def test_for_each_applies_one_rule_to_each_name_of_a_set(tmp_path: Path) -> None:
    text = SETS.replace("{}", 'at("{each}", pick("{metal}"))')
    text = text.replace("says:", "for_each: wet rooms\n    says:")
    (rule,) = read_rules(write_rules(tmp_path, text))
    assert str(rule.formula) == " and ".join(
        rf'not tr.Exists(at("{room}", pick(r"fork|pan \(old\)")))' for room in ("bathroom", "alice's shower")
    )


UNKNOWN_SET = SETS.replace("{}", 'pick("{each}")').replace("says:", "for_each: meta\n    says:")
LEAVING = "rules:\n  - name: a\n    says: b\n    leaving: last_found('door')\n    refuse: true\n"


def test_leaving_rule_may_be_false_at_first_and_refuse(tmp_path: Path) -> None:
    (rule,) = read_rules(write_rules(tmp_path, LEAVING))
    assert (rule.when, rule.refuse) == ("leaving", True)


@pytest.mark.parametrize(
    ("text", "line", "named"),
    [
        (SETS.replace("{}", 'pick("{metl}")'), 8, ["no set metl", "metal, wet rooms"]),
        (SETS.replace("{}", 'pick("{each}")'), 8, ["{each}", '"for_each"']),
        (SETS.replace("metal:", "each:"), 3, ["each"]),
        (SETS.replace("metal:", "3:"), 3, []),
        (SETS.replace('[fork, "pan (old)"]', "[]"), 3, ['"metal"']),
        (SETS.replace('[fork, "pan (old)"]', "fork"), 3, ['"metal"']),
        (SETS.replace("fork", "1"), 3, []),
        (UNKNOWN_SET, 7, ["no set meta;", "metal, wet rooms"]),
        (EACH_ROOM.replace("{each}", "{metal}"), 6, ['"for_each"']),
        (EACH_ROOM.replace("{each}", "{each}{metal}"), 6, ["no set metal", '"sets"']),
        (LEAVING.replace("refuse: true", "always: 'x'"), 4, ["exactly one"]),
        (LEAVING.replace("leaving", "leave"), 4, ['"leave" is unknown']),
        (EACH_ROOM.replace("{each}", "kitchen"), 6, ["{each}", '"for_each"']),
        (EACH_ROOM.replace("alice's", '"alice"'), 5, []),
        (EACH_ROOM.replace("[kitchen, alice's office]", "[]"), 5, ['"for_each"']),
        (EACH_ROOM.replace("[kitchen, alice's office]", "kitchen"), 5, ['"for_each"']),
        (EACH_ROOM.replace("kitchen,", "'a(',"), 6, ["not a valid regex"]),
        ("- a\n", 1, ["is [", "a mapping"]),
        ("rules: []\n", 1, ['"rules"']),
        ("rules:\n  - name: a\n    says: b\n", 2, ['"a"', '"always"', '"finally"']),
        (
            f"rules:\n  - name: a\n    says: b\n    always: '{ATTIC}'\n    finally: '{ATTIC}'\n",
            5,
            ["exactly one"],
        ),
        (f"rules:\n  - name: Big\n    says: b\n    always: '{ATTIC}'\n", 2, ['"name"', "lower-case letters"]),
        (
            f"rules:\n  - name: a\n    say: b\n    always: '{ATTIC}'\n",
            3,
            ['"say" is unknown', "spelling"],
        ),
        (
            f"rules:\n  name: a\n  says: b\n  always: '{ATTIC}'\n",
            1,
            ['"rules" is {', 'entries begin with "- "'],
        ),
        ("rules:\n  - name: a\n    says: b\n    always: not tr.Exists(go_to('x'))\n", 4, ["mean goto?"]),
        (
            "rules:\n  - name: a\n    says: b\n    always: not tr.Exists(is_in_room('x'))\n",
            4,
            ["mean check?"],
        ),
        (
            "rules:\n  - name: a\n    says: b\n    always: not tr.Exists(goto(hall))\n",
            4,
            ["quotes around it"],
        ),
        (f"rules:\n  - name: a\n    always: '{ATTIC}'\n", 2, ['"says"', "missing"]),
        (f"rules:\n  - name: a\n    says: b\n    whenever: '{ATTIC}'\n", 4, ['"whenever"']),
        (
            "rules:\n  - name: a\n    says: b\n    always: not tr.Exist(goto('x'))\n",
            4,
            ["column 8, at Exist(goto(", "Exists?"],
        ),
        ("rules:\n  - name: a\n    says: b\n    always: tr.Exists(fly('x'))\n", 4, ["unknown element fly"]),
        (
            "rules:\n  - name: a\n    says: b\n    always: tr.Exists(say('hello'))\n",
            4,
            ["before anything", 'not tr.Last(goto(".*")) or ..., or'],
        ),
        (f"rules:\n  - name: a\n    says: b\n    finally: '{ATTIC}'\n    refuse: true\n", 5, ['"refuse"']),
        (f"rules:\n{TWICE}{TWICE}", 5, ['"a"', "twice"]),
        (
            "rules:\n  - name: a\n    says: b\n    always: not tr.Exists(say('knock.*door'))\n",
            4,
            ["knock.*door", "too much time"],
        ),
    ],
)
def test_fault_is_a_one_line_error_with_file_and_line(
    tmp_path: Path, text: str, line: int, named: list[str]
) -> None:
    path = write_rules(tmp_path, text)
    with pytest.raises(UserError) as caught:
        read_rules(path)
    assert (caught.value.file, caught.value.line) == (path, line)
    assert "\n" not in caught.value.sentence
    assert [name for name in named if name not in caught.value.sentence] == []


# --- programs


def problems(tmp_path: Path, *body: str) -> list[str]:
    program = "def task_program():\n" + "".join(f"    {line}\n" for line in body)
    found = check(program, rooms=ROOMS, house_rules=read_rules(write_rules(tmp_path)))
    return [problem.sentence for problem in found.problems]


RETURNS = ("go_to('start_loc')", "say('done')")


def test_a_program_that_keeps_all_rules_is_accepted(tmp_path: Path) -> None:
    assert problems(tmp_path, "go_to('kitchen')", "say('knock')", 'go_to("alice\'s office")', *RETURNS) == []


def test_broken_rule_is_a_problem_with_line_rule_and_world(tmp_path: Path) -> None:
    (problem,) = problems(
        tmp_path, "go_to('kitchen')", "if is_in_room('mug'):", "    go_to('server room')", *RETURNS
    )
    assert problem == (
        'line 4: RuleViolation: the rule "server-room" forbids going to "server room": '
        'Never go into the server room, where "mug" is in "kitchen"'
    )


def test_two_rules_broken_at_one_line_are_two_problems(tmp_path: Path) -> None:
    found = problems(
        tmp_path,
        "room = 'server room' if is_in_room('mug') else \"alice's office\"",
        "for _ in range(2):",
        "    go_to(room)",
        *RETURNS,
    )
    assert [problem.split('"')[1] for problem in found] == ["knock", "server-room"]
    assert all(problem.startswith("line 4: RuleViolation: ") for problem in found)


def test_rule_broken_at_the_end_is_a_problem_without_a_line(tmp_path: Path) -> None:
    (problem,) = problems(tmp_path, "go_to('kitchen')")
    assert problem.startswith('RuleViolation: the rule "report" is not kept at the end: At the end, tell')


def test_leaving_rule_is_a_problem_at_the_drive_or_at_the_end(tmp_path: Path) -> None:
    locked = 'not tr.AfterLast(say("^closed")).Exists(say("^opened"))'
    text = f"rules: [{{name: locked, says: Lock up., leaving: '{locked}'}}]"
    house_rules = read_rules(write_rules(tmp_path, text))
    program = "def task_program():\n    say('opened')\n    {}\n    go_to('kitchen')\n    {}\n"
    for first, last, line in (
        ("say('hello')", "say('closed')", 4),
        ("say('closed')", "say('opened again')", None),
        ("say('closed')", "say('bye')", 0),
    ):
        found = check(program.format(first, last), rooms=ROOMS, house_rules=house_rules)
        assert [problem.line for problem in found.problems] == ([] if line == 0 else [line])


def test_checks_find_worlds_that_lead_into_every_branch(tmp_path: Path) -> None:
    """Only the last of four options of each nested question leads to the broken rule."""
    options = "['a', 'b', 'c', 'd']"
    (problem,) = problems(
        tmp_path,
        f"if ask('', 'First?', {options}) == 'd':",
        f"    if ask('', 'Second?', {options}) == 'd':",
        "        go_to('server room')",
        *RETURNS,
    )
    assert problem.startswith("line 4: RuleViolation")


MISSPELT_ROOM = """rules:
  - name: bob
    says: Leave Bob alone.
    always: >-
      not tr.Exists(goto("bobs office"))
"""
HOUSE = ["hall", "bob's office", "server room|vault"]


def test_misspelt_room_is_refused_with_its_line_and_the_closest_name(tmp_path: Path) -> None:
    path = write_rules(tmp_path, MISSPELT_ROOM)
    with pytest.raises(UserError) as caught:
        read_rules(path, rooms=HOUSE)
    assert (caught.value.file, caught.value.line) == (path, 4)
    for named in ('"bobs office"', '"bob\'s office"', '"any: true"'):
        assert named in caught.value.sentence
    assert len(read_rules(path)) == 1, "without known rooms, no name can be misspelt"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("bobs office", "bob's office"),
        ("bobs office", "office"),
        ("bobs office", "vault"),
        ("bobs office", ".*"),
        ("says:", "any: true\n    says:"),
    ],
)
def test_rule_may_name_known_rooms_or_allow_any_room(tmp_path: Path, old: str, new: str) -> None:
    (rule,) = read_rules(write_rules(tmp_path, MISSPELT_ROOM.replace(old, new)), rooms=HOUSE)
    assert rule.any_room is ("any" in new)


@pytest.mark.parametrize(
    "formula",
    [
        'not tr.Exists(at("bobs office", say(".*")))',
        'not tr.Exists(goto(without("bobs office")))',
        'not tr.Exists(goto("hall|halls")) or tr.Exists(goto("bobs office"))',
    ],
)
def test_a_misspelt_room_is_found_anywhere_in_a_rule(tmp_path: Path, formula: str) -> None:
    text = MISSPELT_ROOM.replace('not tr.Exists(goto("bobs office"))', formula)
    with pytest.raises(UserError, match="bobs office"):
        read_rules(write_rules(tmp_path, text), rooms=HOUSE)


def test_misspelt_room_in_a_set_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "house.yaml"
    path.write_text(
        "sets: {forbidden: [server room, valt]}\nrules:\n  - name: out\n    says: Stay out.\n"
        '    always: not tr.Exists(goto("{forbidden}"))\n'
    )
    assert read_rules(path, rooms=["server room", "valt"])
    with pytest.raises(UserError, match="valt") as raised:
        read_rules(path, rooms=["server room", "vault"])
    assert raised.value.line == 5
