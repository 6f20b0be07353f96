"""Claims of texts: numbers of things, times of day, affirmations and denials."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codebotler.core.trace import Event, Option
from codebotler.rtl import Claim, Number, RtlSyntaxError, Time, holds, parse
from codebotler.rtl.text.times import times_in

SAVORY = [
    ("2 people chose savory snacks", {2}),
    ("Of the 4 people asked, 2 chose savory snacks.", {2}),
    ("2 out of 4 people chose savory", {2}),
    ("2 out of a total of 4 people chose savory", {2}),
    ("A total of 2 people chose savory", {2}),
    ("Savory x2, sweet x1", {2}),
    ("2x savory, 1x sweet", {2}),
    ("2pcs savory, 1pcs sweet", {2}),
    ("At 3pm 2people chose savory", {2}),
    ("room1a, 3d, 4b, 5th and 2nd", set()),
    ("I met 3 people, and the number of savory choices was 2.", {2}),
    ("Savory choices: 2", {2}),
    ("Number of savory choices in total, 2", {2}),
    ("2 people chose a savory one", {2}),
    ("Nobody chose savory", {0}),
    ("No one picked a savory snack", {0}),
    ("People did not pick any savory snack", {0}),
    ("There are twenty-two savory and 1 sweet", {22}),
    ("1 savory or 2 savory", {1, 2}),
    ("Not one person chose savory", {0}),
    ("Not a single savory choice", {0}),
    ("The number of savory choices is not 2", set()),
    ("It was not 2 but 3 people who chose savory", {3}),
    ("They didn't choose 2 savory snacks", {2}),
    ("0", {0}),
    ("10 people", {10}),
    ("0 1 2 3", {0, 1, 2, 3}),
    ("At least 2 people chose savory", set()),
    ("More than 3 savory choices", set()),
    ("2 dozen savory choices", set()),
    ("2 or so chose savory", set()),
    ("2 chose savory. That was no problem", {2}),
    ("Did 2 choose savory?", set()),
    ("I looked into 4 offices", set()),
    ("2 people in the offices would take one", {2}),
    ("Nobody in the offices would take one", {0}),
    ("Savory takers, all offices together: 2", {2}),
    ("Just the one savory snack was taken, and the one sweet", {1}),
    ("Of those in all the offices, 2 took one", {2}),
    ("Savory snacks are not needed", {0}),
    ("Savory snacks aren't wanted", {0}),
    ("A dozen savory snacks", {12}),
    ("A single savory snack", {1}),
    ("2 savory snacks instead of 3", {2}),
    ("Sweet? Two. Savory? None.", {0}),
    ("someone", set()),
    ("", set()),
]


@pytest.mark.parametrize(("text", "given"), SAVORY)
def test_number_belongs_to_its_thing(text: str, given: set[int]) -> None:
    assert Number(0, "savory", ("sweet", "office")).given(text) == given
    for number in range(5):
        assert Number(number, "savory", ("sweet", "office")).matches(text) == (given == {number})
        is_other = bool(given) and given != {number}
        assert Number(number, "savory", ("sweet", "office"), other=True).matches(text) == is_other


def test_longest_of_nested_names_owns_the_number() -> None:
    other = Number(0, "tea", ("iced tea", "tea"))
    assert other.given("2 iced teas, 3 teas") == {3}
    assert other.given("room 4 tea") == {4}
    assert Number(0, "room 4", ("room",)).given("2 in room 4, 3 rooms") == {2}


def test_a_long_text_is_read_to_its_end() -> None:
    assert Number(0, "tea", ("room",)).given("in a room with tea, " * 5_000 + "2 teas") == {2}


@pytest.mark.parametrize(
    "unit",
    [
        "F",
        "\N{DEGREE SIGN}",
        "\N{DEGREE SIGN}F",
        "\u00baF",
        "degF",
        "deg",
        "fahrenheit",
        "days",
        "p.m.",
        "min",
    ],
)
def test_a_unit_may_touch_its_number(unit: str) -> None:
    assert Number(72, "degrees?").given(f"It is 72{unit} now") == {72}


@pytest.mark.parametrize(
    ("text", "given"),
    [
        ("60% said yes", {60}),
        ("60.0 percent", {60}),
        ("6 of 10 people, so 60%", {60}),
        ("40%, 60%", {40, 60}),
    ],
)
def test_percentage_belongs_to_its_sign(text: str, given: set[int]) -> None:
    assert Number(0, "%|percent").given(text) == given


THINGS = ["apple", "pear", "plum"]
COUNTS = st.lists(st.integers(0, 30), min_size=3, max_size=3)


@given(
    COUNTS,
    st.permutations(range(3)),
    st.sampled_from(["{n} {t}s", "{t}s: {n}", "{n} people want a {t}", "the {t}s needed are {n}"]),
    st.sampled_from([", ", " and ", "; ", ". ", ", and "]),
    st.sampled_from(["", "Please buy: ", "We need ", "Hello! "]),
)
def test_each_of_several_things_has_its_own_number(
    counts: list[int], order: list[int], form: str, joint: str, start: str
) -> None:
    text = start + joint.join(form.format(n=counts[at], t=THINGS[at]) for at in order)
    for at, thing in enumerate(THINGS):
        others = tuple(other for other in THINGS if other != thing)
        assert Number(0, thing, others).given(text) == {counts[at]}, text


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ('2 people said yes to the question "Do you want a plant?"', {2}),
        ("2 people said yes to: Do you want a plant?", {2}),
        ("There were 2 'yes' answers to the question do you want a plant?", {2}),
        ("2 people said yes to 'Do you want 3 plants?'", {2}),
        ("Do 2 people want to have a plant?", set()),
        ("Did 2 people say yes?", set()),
    ],
)
def test_quoted_question_does_not_hide_a_number(text: str, numbers: set[int]) -> None:
    assert Number(0, "people|yes", ()).given(text) == numbers


TIMES = [
    ("12:00", [(0, 720)]),
    ("12 pm", [(720,)]),
    ("1:15 PM", [(795,)]),
    ("lunch at noon", [(720,)]),
    ("1", [(60, 780)]),
    ("around one", [(60, 780)]),
    ("13:00", [(780,)]),
    ("1:30 p.m.", [(810,)]),
    ("at 12p.m. or 11:30a.m.", [(720,), (690,)]),
    ("in room 1a. Maybe 12 pm", [(720,)]),
    ("half past twelve", [(30, 750)]),
    (
        "at six in the evening, at 4 in the morning, or at two o'clock in the afternoon",
        [(1080,), (240,), (840,)],
    ),
    ("quarter to 12 pm", [(705,)]),
    ("twelve o'clock", [(0, 720)]),
    ("12:00 - 13:00", [(0, 720), (780,)]),
    ("midnight", [(0, 1440)]),
    ("12?", [(0, 720)]),
    ("Mark wants to leave at 5.", [(300, 1020)]),
    ("She said: twelve", [(0, 720)]),
    ("I was at 3 offices", []),
    ("an hour before 7 pm", []),
    ("anything but 12:00", []),
    ("not at 5 pm but at 6 pm", [(1080,)]),
    ("in 5 minutes", []),
    ("room 12 or 1?", []),
    ("99:00", []),
]


@pytest.mark.parametrize(("text", "times"), TIMES)
def test_times_of_day_are_found(text: str, times: list[tuple[int, ...]]) -> None:
    assert [*times_in(text)] == times


def test_time_matches_within_its_range_and_other_outside() -> None:
    lunch, odd = Time("11:00", "14:30"), Time("11:00", "14:30", other=True)
    for text, is_lunch, is_odd in [
        ("1 pm", True, False),
        ("1:00", True, False),
        ("17:00", False, True),
        ("12:00 or 18:00", False, True),
        ("soon", False, False),
    ]:
        assert (lunch.matches(text), odd.matches(text)) == (is_lunch, is_odd), text


@pytest.mark.parametrize(
    ("text", "affirmed", "denied"),
    [
        ("Alice and Bob are joining", "alice bob", ""),
        ("Alice and Bob are not joining", "", "alice bob"),
        ("Joining: Alice. Declined: Bob", "alice", "bob"),
        ("Alice is joining but Bob isn't", "alice", "bob"),
        ("Neither Alice nor Bob is coming", "", "alice bob"),
        ("Not joining: Alice, Bob", "", "alice bob"),
        ("Alice said yes and Bob said no", "alice", "bob"),
        ("Alice, Bob", "alice bob", ""),
        ("Nobody is coming", "", ""),
        ("There is no ['old alice', 'bob']", "", "alice bob"),
        ("Here we lack: sliced bread, old Alice, Bob", "", "alice bob"),
        ("He saw Alice, Bob, he did not see Carl", "alice bob", ""),
        ("I know Alice and another Alice", "alice", ""),
        ("malice", "", ""),
        # Questions and guesses claim nothing.
        ("Is Alice coming?", "", ""),
        ("Did Alice say yes, Bob?", "", ""),
        ("Is Alice coming, or not?", "", ""),
        ("Hello Alice, how are you?", "alice", ""),
        ("Alice is coming, ok?", "alice", ""),
        ("How about Alice?", "alice", ""),
        ("Could you please get Alice, Bob?", "alice bob", ""),
        ("Maybe Alice is coming. Bob might not.", "", ""),
        ("I do not know whether Alice comes", "", ""),
        ("I am not sure about Alice", "", ""),
        ("Alice has not decided yet", "", ""),
        ("I hope Alice joins", "", ""),
        ("Alice and I hope that you enjoy it", "alice", ""),
        ("Alice would love to, but is busy", "", ""),
        ("Alice would love to", "alice", ""),
        ("I asked Alice if she would come and she said yes", "alice", ""),
        ("I asked Alice whether she would come but she declined", "", "alice"),
        ("I asked Alice", "", ""),
        ("Everyone I asked in the room of Alice declined", "", "alice"),
        # Harmless words deny nothing, and a double denial affirms.
        ("Alice is coming and that is no problem at all", "alice", ""),
        ("Alice, don't be late", "alice", ""),
        ("Don't forget Alice", "alice", ""),
        ("Alice had no objections", "alice", ""),
        ("There is no need to ask Alice", "alice", ""),
        ("Not only Alice is coming", "alice", ""),
        ("Alice did not decline", "alice", ""),
        ("Nobody but Bob refused. Alice does not lack anything", "alice", "bob"),
        ("No room of Alice is missing a stapler", "alice", ""),
        ("There are no rooms of Bob without one", "bob", ""),
        ("Without any: none. Alice", "alice", ""),
        ("You will not be alone, Alice. Bob wants to leave at 5, not earlier", "alice bob", ""),
        # Some words deny without a negation.
        ("Alice turned the invitation down. Bob has other plans", "", "alice bob"),
        ("The answer of Alice is negative", "", "alice"),
        # A denial applies to the names of its own clause.
        ("In the room of Alice, there is no stapler", "", "alice"),
        ("In Bob's room, there is one, and in Alice's room, there is none", "bob", "alice"),
        ("Bob has a pen, but Alice has paper but no pen", "alice bob", "alice"),
        ("You will not be alone: Alice comes", "alice", ""),
        ("We have a pen, Alice and Carol but not Bob", "alice", "bob"),
        ("They met Carol, Alice and lack Bob", "alice", "bob"),
        ("Alice is not joining, Bob is but not Carol", "bob", "alice"),
        ("Alice has no mail, Bob has but not Carol", "bob", "alice"),
        ("We can count on Carol and Alice and no Bob", "alice", "bob"),
        ("You need not go: Alice, Bob", "", "alice bob"),
        ("As for Alice, it is there, and Bob, I am afraid, is not", "alice", "bob"),
        ("Anything but Alice", "alice", ""),
        # An exception has the opposite claim.
        ("Everyone but Bob is coming", "", "bob"),
        ("Nobody apart from Alice wants to come", "alice", ""),
        ("All the rooms except Bob's have one", "", "bob"),
        ("All of them are missing other than Alice", "alice", ""),
        ("All is well, but Bob is coming, and none of them was late, but Alice is here", "alice bob", ""),
        ("Everything of theirs is here with the exception of Alice", "", "alice"),
        ("May your visit be nice, Alice. Bob may come", "alice", ""),
        ("You will look for Alice in vain", "", "alice"),
        ("I told everybody but nobody believed Alice", "", "alice"),
        # A search in vain denies.
        ("I looked for one in the room of Alice, but could not find any", "", "alice"),
        (
            "Alice's room is done, nothing there. I checked the one of Bob, and there was no pen",
            "",
            "alice bob",
        ),
        ("I looked in on Alice, but there was no pen in Bob's room", "alice", "bob"),
        # Short answers and alternatives count.
        ("Alice? Yes. Bob? No.", "alice", "bob"),
        ("I took Alice rather than Bob", "alice", "bob"),
        ("Choose Alice instead of Bob. Instead of Bob, Alice", "alice", "bob"),
        # Plans claim nothing.
        ("I will ask Alice. I'm going to look for Bob", "", ""),
        ("Alice needs to think about it, and Bob wants to know more", "", ""),
        ("We are out of tea, Alice. He's out of milk, Bob", "", "alice bob"),
        ("There is no shortage of Alice", "alice", ""),
        ("Alice will have to pass", "", "alice"),
    ],
)
def test_claims_are_affirmed_or_denied(text: str, affirmed: str, denied: str) -> None:
    for name in ("alice", "bob"):
        assert Claim(name).matches(text) == (name in affirmed.split()), name
        assert Claim(name, denied=True).matches(text) == (name in denied.split()), name


def test_mention_matches_the_question_or_any_option() -> None:
    options = (Option("1", is_text=False), Option("tea"))
    asks = (Event("ask", "Which drink?", options),)
    assert holds(parse('tr.Exists(mention("tea"))'), asks)
    assert holds(parse('tr.Exists(mention("drink"))'), asks)
    assert not holds(parse('tr.Exists(mention("water"))'), asks)


def test_answered_matches_only_the_chosen_option() -> None:
    formula = parse('tr.Exists(answered(time("12:00", "12:00")))')
    options = (Option("11:00"), Option("noon"))
    assert holds(formula, (Event("ask", "When?", options, "noon"),))
    assert not holds(formula, (Event("ask", "When?", options, "11:00"),))
    assert not holds(formula, (Event("ask", "When?", options),))


def test_at_matches_only_events_in_that_room() -> None:
    formula = parse('tr.Exists(at("lab 1", say("hello")))')
    assert holds(formula, (Event("say", "hello", place="lab 1"),))
    assert not holds(formula, (Event("say", "hello", place="lab 12"),))


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ('tr.Exists(say(number("2", "mug")))', "expected a whole number"),
        ("tr.Exists(say(number(2)))", "number takes"),
        ('tr.Exists(say(time("noon", "14:00")))', '"noon" is not a time of day such as "11:30"'),
        ('tr.Exists(at("a", at("b", say("c"))))', "at cannot be nested in another at"),
        ('tr.Exists(say(affirm("a")))', "did you mean affirms?"),
        ('tr.Exists(mention("a", "b"))', "mention takes 1 argument, not 2"),
    ],
)
def test_error_names_the_mistake(text: str, problem: str) -> None:
    with pytest.raises(RtlSyntaxError, match=re.escape(problem)):
        parse(text)


@pytest.mark.parametrize(
    "text",
    [
        'tr.Exists(at("lab", mention("tea")))',
        'tr.Exists(at("lab", answered("tea")))',
        r'tr.Exists(say(othernumber(2, r"mugs\b", "cup")))',
        'tr.Exists(say(words(time("11:00", "14:30"), denies("bob"))))',
    ],
)
def test_printed_formula_can_be_parsed_again(text: str) -> None:
    assert str(parse(text)) == text
    assert parse(str(parse(text))) == parse(text)
