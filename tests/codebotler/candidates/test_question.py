"""The question is asked only if it pays, about the world that shows the difference best."""

from dataclasses import replace

import pytest

from codebotler.candidates.behaviour import behaviour_of
from codebotler.candidates.clusters import CandidateCluster, CandidateClusters
from codebotler.candidates.question import ClarifyingQuestion, describe_differences, question_about
from codebotler.checking.problems import Sample
from codebotler.core.errors import UserError
from codebotler.core.trace import Event, Option, Outcome, Status, Trace
from codebotler.simulator.worlds.sampled_facts import ANSWER_FORM, SampledFact, whereabouts

MUG, NO_MUG = (whereabouts("mug", "lab", is_there=there) for there in (True, False))
CUP = whereabouts("cup", "lab", is_there=True)


def say(text: str, room: str = "hall") -> Event:
    return Event("say", text, place=room)


def drive(start: str, end: str) -> Event:
    return Event("goto", end, place=start, destination=end)


def cluster(size: int, name: str, *traces: Trace) -> CandidateCluster:
    """Make a cluster from its run in each world. Every world has a cup, and only the first a mug."""
    outcomes = [Outcome(Status.FINISHED, trace) for trace in traces]
    samples = tuple(
        Sample(number, one, (CUP, NO_MUG if number else MUG)) for number, one in enumerate(outcomes)
    )
    return CandidateCluster((name,), size, tuple(behaviour_of(one, "hall") for one in outcomes), samples)


def ask_about(*clusters: CandidateCluster) -> ClarifyingQuestion:
    question = question_about(CandidateClusters(clusters))
    assert question is not None
    return question


ONE, TWO, THREE = ((say(f"{number} mugs"),) for number in (1, 2, 3))


def test_no_question_about_one_behaviour() -> None:
    assert question_about(CandidateClusters((cluster(4, "a", ONE),))) is None


def test_no_question_if_one_behaviour_dominates() -> None:
    other = cluster(2, "b", TWO)
    assert question_about(CandidateClusters((cluster(6, "a", ONE), other))) is None
    assert question_about(CandidateClusters((cluster(5, "a", ONE), other))) is not None


def test_question_uses_the_world_with_the_most_different_options() -> None:
    question = ask_about(cluster(2, "a", ONE, ONE), cluster(2, "b", TWO, ONE), cluster(1, "c", TWO, TWO))
    assert (question.sample, [one.program for one in question.options]) == (0, ["a", "b"])
    question = ask_about(cluster(2, "a", ONE, ONE), cluster(2, "b", TWO, TWO), cluster(1, "c", TWO, THREE))
    assert (question.sample, [one.program for one in question.options]) == (1, ["a", "b", "c"])


def test_question_offers_at_most_the_three_largest_options() -> None:
    four = (say("4 mugs"),)
    question = ask_about(*(cluster(4 - n, str(n), run) for n, run in enumerate([ONE, TWO, THREE, four])))
    assert [(one.program, one.size) for one in question.options] == [("0", 4), ("1", 3), ("2", 2)]
    assert question.total == 10
    assert "1 program " in question.left_out
    assert not ask_about(cluster(2, "a", ONE), cluster(1, "b", TWO)).left_out
    clusters = CandidateClusters(
        (cluster(2, "a", ONE), cluster(1, "b", TWO)), rejected=("no lab", "no hall", "no lab")
    )
    rest = question_about(clusters)
    assert rest is not None
    assert "3 programs that the check rejects (2 of them: no lab)" in rest.left_out


def test_an_option_that_waits_without_success_says_so() -> None:
    waits = cluster(2, "a", ONE, ONE)
    waits = replace(waits, samples=(waits.samples[0], replace(waits.samples[1], in_vain=True)))
    shares = [one.share for one in ask_about(waits, cluster(2, "b", TWO, TWO)).options]
    assert [("without success" in share) for share in shares] == [True, False]


def test_a_shorter_storyboard_is_preferred() -> None:
    look = Event("check", "mug", found=True, place="hall")
    assert ask_about(cluster(1, "a", (look, *ONE), ONE), cluster(1, "b", TWO, TWO)).sample == 1


def test_a_world_in_which_a_search_is_seen_is_preferred() -> None:
    found = Event("check", "mug", found=True, place="lab")
    search = (
        replace(found, found=False, place="hall"),
        drive("hall", "lab"),
        found,
        drive("lab", "hall"),
        *ONE,
    )
    assert ask_about(cluster(1, "a", (found, *ONE), search), cluster(1, "b", TWO, TWO)).sample == 1


def test_a_world_in_which_the_most_frequent_behaviour_does_something_is_preferred() -> None:
    drives = (drive("hall", "lab"),)
    assert ask_about(cluster(2, "a", drives, (*drives, *ONE)), cluster(1, "b", TWO, TWO)).sample == 1


def test_a_world_in_which_all_options_do_something_is_preferred() -> None:
    assert ask_about(cluster(2, "a", ONE, ONE), cluster(1, "b", (), TWO)).sample == 1


def test_a_world_in_which_options_act_in_different_rooms_is_preferred() -> None:
    lab = (drive("hall", "lab"), say("hello", "lab"), drive("lab", "hall"))
    idle = (drive("hall", "lab"), drive("lab", "hall"))
    speaks = cluster(3, "speaks anyway", (*lab, say("2 told")), (*lab, say("2 told")))
    looks = cluster(2, "looks first", (*lab, say("told 1 and 1")), (*idle, say("told 1")))
    assert ask_about(speaks, looks).sample == 1


def test_options_that_are_alike_in_the_world_are_told_apart_from_others() -> None:
    three = cluster(3, "a", ONE, ONE), cluster(2, "b", TWO, TWO), cluster(1, "c", ONE, TWO)
    question = ask_about(*three)
    assert ["1 other " in one.share for one in question.options] == [True, False]
    assert [one.size for one in question.options] == [4, 2]
    assert "something else" not in question.left_out


def test_options_that_finish_come_first() -> None:
    waits, ends = cluster(3, "waits", ONE), cluster(2, "ends", TWO)
    behaviour = replace(waits.behaviours[0], ending="waits")
    question = ask_about(replace(waits, behaviours=(behaviour,)), ends)
    assert [one.program for one in question.options] == ["ends", "waits"]


def test_rooms_of_the_same_thing_are_one_fact_and_what_only_some_options_learn_comes_first() -> None:
    mug, too = (whereabouts("mug", room, is_there=True) for room in ("lab", "den"))
    pen, no_cup = whereabouts("pen", "lab", is_there=True), whereabouts("cup", "den", is_there=False)
    one, other = cluster(1, "a", ONE), cluster(1, "b", TWO)
    one = replace(one, samples=(replace(one.samples[0], facts=(mug, pen, too)),))
    other = replace(other, samples=(replace(other.samples[0], facts=(mug, pen, too, no_cup)),))
    assert ask_about(one, other).facts == (no_cup.sentence, '"mug" is in "den" and "lab"', pen.sentence)


def test_facts_that_hold_come_first() -> None:
    absent = whereabouts("ann", "lab", is_there=False)
    one, other = (
        replace(each, samples=(replace(each.samples[0], facts=(absent, MUG)),))
        for each in (cluster(1, "a", ONE), cluster(1, "b", TWO))
    )
    assert ask_about(one, other).facts == (MUG.sentence, absent.sentence)


def test_difference_in_statements_is_preferred_to_one_in_own_skills() -> None:
    waves = (Event("wave", "left", place="hall"),)
    assert ask_about(cluster(1, "a", waves, (*ONE, *ONE)), cluster(1, "b", (), TWO)).sample == 1


def test_world_where_options_disagree_about_people_in_a_room_is_avoided() -> None:
    met = Event("check", "Ann", found=True, place="hall")
    empty = Event("check", "person", found=False, place="hall")
    question = ask_about(cluster(1, "a", (met, *ONE), ONE), cluster(1, "b", (empty, *TWO, *TWO), TWO))
    assert question.sample == 1
    elsewhere = replace(met, place="lab")
    question = ask_about(cluster(1, "a", (elsewhere, *ONE), ONE), cluster(1, "b", (empty, *TWO, *TWO), ONE))
    assert question.sample == 0


def test_world_that_one_option_contradicts_is_avoided() -> None:
    picked = Event("pick", "stapler", place="lab")
    missed = Event("check", "stapler", found=False, place="lab")
    asked = Event("ask", "Tea?", options=(Option("yes"),), answer="yes", to="Ann", place="hall")
    asked_again = replace(asked, answer="no")
    absent = Event("check", "Ann", found=False, place="hall")
    elsewhere = Event("check", "Ann", found=True, place="lab")
    for one, other in ((picked, missed), (asked, absent), (asked, elsewhere), (asked, asked_again)):
        question = ask_about(cluster(1, "a", (one, *ONE), ONE), cluster(1, "b", (other, *TWO, *TWO), TWO))
        assert question.sample == 1, (one, other)
    after = (picked, missed)  # It is gone because this robot has it.
    question = ask_about(cluster(1, "a", (*after, *ONE), ONE), cluster(1, "b", (*TWO, *TWO), ONE))
    assert question.sample == 0


def test_only_facts_that_matter_are_shown() -> None:
    one, other = cluster(1, "a", ONE, ONE), cluster(1, "b", TWO, ONE)
    assert ask_about(one, other).facts == (MUG.sentence,)
    always = [cluster(1, name, run, run) for name, run in (("a", ONE), ("b", TWO))]
    assert ask_about(*always).facts == (CUP.sentence, MUG.sentence), "all facts if options always differ"


def test_options_show_their_steps_in_the_world() -> None:
    first, _ = ask_about(cluster(1, "a", ONE), cluster(1, "b", TWO)).options
    assert [(step["kind"], step["text"]) for step in first.steps] == [("say", "1 mugs")]


def differences_of(*traces: Trace) -> list[tuple[str, frozenset[int]]]:
    made = [cluster(1, "a", trace) for trace in traces]
    return describe_differences([one.samples[0] for one in made], [one.behaviours[0] for one in made])


def describe(*traces: Trace) -> list[str]:
    return [words for words, _ in differences_of(*traces)]


def test_sentences_describe_only_differences() -> None:
    greets = drive("hall", "lab"), say("Hello", "lab"), drive("lab", "hall")
    assert describe((*greets, *ONE), greets) == ['says "1 mugs" in hall', 'only says "Hello" in lab']
    assert describe((drive("hall", "lab"),), ()) == ["drives and looks and ends in lab", "does nothing"]
    assert describe((*ONE, drive("hall", "lab")), ()) == [
        'says "1 mugs" in hall and ends in lab',
        "does nothing",
    ]
    assert [own for _, own in differences_of((*ONE, drive("hall", "lab")), ())] == [{1, 2}, set()]
    assert describe(ONE, ()) == ['says "1 mugs" in hall', "does nothing"]
    look = Event("check", "mug", found=False, place="hall")
    assert describe(ONE, (look,)) == ['says "1 mugs" in hall', "only drives and looks"]


def test_steps_that_all_options_share_are_not_their_own() -> None:
    asks = Event("ask", "Tea?", options=(Option("yes"), Option("no")), answer="no", to="Ann", place="lab")
    picks = Event("pick", "mug", place="lab")
    look = Event("check", "mug", found=True, place="lab")
    (asked, own), (rest, none) = differences_of((look, picks, asks, picks, say("Bye")), (picks, say("Bye")))
    assert (own, none) == (frozenset({3, 4}), frozenset[int]())
    assert asked == 'asks "Tea?" of "Ann" in lab and also picks up "mug" in lab'
    assert rest == 'only picks up "mug" in lab and says "Bye" in hall'


def test_more_of_what_all_options_do_is_said_after_also() -> None:
    shared = drive("hall", "lab"), say("1 mug", "lab")
    more = drive("lab", "den"), say("1 mug", "den"), drive("den", "lab")
    assert describe((*shared, *more), shared) == ['also says "1 mug" in den', 'only says "1 mug" in lab']


def test_questions_with_other_options_or_of_other_people_are_own_steps() -> None:
    ask = Event("ask", "Tea?", options=(Option("yes"),), answer="yes", to="Ann", place="lab")
    other_words, other_option = replace(ask, text="Some tea?"), replace(ask, options=(Option("no"),))
    assert [own for _, own in differences_of((ask, say("1 mugs")), (other_words, say("2 mugs")))] == [
        {2},
        {2},
    ]
    for other in (other_option, replace(ask, to="Bob")):
        assert [own for _, own in differences_of((ask,), (other,))] == [{1}, {1}]


def test_sentence_leaves_out_what_tells_no_option_apart() -> None:
    yes_or_no = Option("yes"), Option("no")
    ask = Event("ask", "Tea?", options=yes_or_no, answer="no", to="person", place="lab")
    there = drive("hall", "lab")
    assert describe((there, ask, ask), (there, ask)) == ['also asks "Tea?" in lab', 'only asks "Tea?" in lab']
    named = replace(ask, to="Ann", options=(*yes_or_no, Option("both")))
    asked, other = describe((ask,), (named,))
    assert asked == 'asks "Tea?" [yes | no] in lab'
    assert other == 'asks "Tea?" [yes | no | both] of "Ann" in lab'
    # Where the robot ends is said unless it has just done something there.
    back = drive("lab", "hall")
    assert describe((there, ask), (there, ask, back)) == [
        'asks "Tea?" in lab',
        'asks "Tea?" in lab and ends in hall',
    ]


def test_sentence_quotes_each_utterance_and_counts_equal_steps() -> None:
    picks = Event("pick", "mug", place="lab"), Event("place", "mug", place="hall")
    two, none = describe((say("Hi"), say("Bye"), *picks, *picks), ())
    assert two.startswith('says "Hi" and "Bye" in hall, picks up "mug" in lab 2 times')
    assert none == "does nothing"


def test_equal_acts_in_the_same_rooms_are_told_together() -> None:
    asks = tuple(Event("ask", f"{what}?", to="Ann", place="lab") for what in ("Tea", "Milk"))
    both, _ = describe((*asks, say("Tea", "lab"), drive("lab", "hall"), say("Milk")), ())
    assert both == 'asks "Tea?" and "Milk?" of "Ann" in lab, says "Tea" in lab and says "Milk" in hall'


def test_waits_are_shown_before_the_next_step() -> None:
    late = replace(say("Tea"), time=300.0)
    first, _ = ask_about(cluster(1, "a", (say("Hi"), late, *ONE)), cluster(1, "b", TWO)).options
    assert [step.get("waited") for step in first.steps] == [None, 300.0, None]


def test_texts_that_differ_late_are_shown_whole() -> None:
    one, other = (f"{'Dear visitors, ' * 8}please leave by door {number}" for number in (1, 4))
    assert describe((say(one),), (say(other),)) == [f'says "{text}" in hall' for text in (one, other)]


def test_a_rejection_names_all_that_an_option_does() -> None:
    shared = (drive("hall", "lab"), say("Hi", "lab"), drive("lab", "hall"))
    question = ask_about(cluster(1, "a", (*shared, *ONE)), cluster(1, "b", shared))
    assert [one.difference for one in question.options] == ['says "1 mugs" in hall', 'only says "Hi" in lab']
    first, second = question.rejections
    assert first.endswith('a robot that says "Hi" in lab and says "1 mugs" in hall')
    assert second.endswith('a robot that says "Hi" in lab and ends in hall')


def test_rejections_name_the_world_that_they_are_about() -> None:
    question = ask_about(cluster(1, "a", ONE, ONE), cluster(1, "b", TWO, ONE))
    assert all(MUG.sentence in one for one in question.rejections)


def test_different_answers_to_the_same_words_are_no_facts() -> None:
    one, other = cluster(1, "a", ONE), cluster(1, "b", TWO)
    facts = [SampledFact(ANSWER_FORM, ("lab", "Tea?", answer)) for answer in ("yes", "green")]
    clusters = [
        replace(each, samples=(replace(each.samples[0], facts=(fact, CUP)),))
        for each, fact in zip((one, other), facts, strict=True)
    ]
    assert ask_about(*clusters).facts == (CUP.sentence,)
    same = [replace(each, samples=clusters[0].samples) for each in clusters]
    assert ask_about(*same).facts == (CUP.sentence,), "the steps show the answer"
    only = [replace(each, samples=(replace(each.samples[0], facts=(facts[0],)),)) for each in same]
    assert ask_about(*only).facts == (facts[0].sentence,)


def test_a_person_who_is_somewhere_is_not_also_said_to_be_absent_elsewhere() -> None:
    lab, den = (whereabouts("ann", room, is_there=room == "den") for room in ("lab", "den"))
    looks = (Event("check", "Ann", found=False, place="lab"), Event("check", "Ann", found=True, place="den"))
    clusters = [
        replace(one, samples=(replace(one.samples[0], facts=(lab, den)),))
        for one in (cluster(1, "a", (*looks, *ONE)), cluster(1, "b", (*looks, *TWO)))
    ]
    assert ask_about(*clusters).facts == (den.sentence,)


def test_sentence_names_what_is_said_and_where() -> None:
    rooms = ["lab", "den", "attic", "cellar", "study"]
    everywhere = tuple(event for one in rooms for event in (drive("", one), say("Lunch!", one)))
    first, second, silent = describe((say("Lunch!"),), (say("Lunch!"), *everywhere), (drive("hall", "lab"),))
    assert first == 'says "Lunch!" in hall'
    assert second == 'says "Lunch!" in hall, lab, den, attic and 2 more'
    assert silent == "only drives and looks and ends in lab"
    back = drive("study", "lab")
    only, _ = describe(
        (say("Lunch!"), *everywhere[:2]), (say("Lunch!"), *everywhere[:2], *everywhere[8:], back)
    )
    assert only == 'only says "Lunch!" in hall and lab'


def test_sentences_of_three_options_tell_all_of_them_apart() -> None:
    rooms = ["hall", *(f"room {number}" for number in range(5))]
    drives = map(drive, rooms, [*rooms[1:], "hall"])
    many = tuple(event for one in drives for event in (say("Hi", one.place), one))
    sentences = describe(many, (), (drive("hall", "lab"),))
    assert len({*sentences}) == 3


@pytest.mark.parametrize(
    ("line", "program"), [("1", "a"), (" 2 \n", "b"), ("none", None), ("None of these.", None)]
)
def test_answers_choose_an_option_or_none(line: str, program: str | None) -> None:
    question = ask_about(cluster(2, "a", ONE), cluster(1, "b", TWO))
    chosen = question.chosen(question.parse(line))
    assert (None if chosen is None else chosen.program) == program


def test_you_decide_means_the_most_frequent_behaviour() -> None:
    question = ask_about(cluster(2, "a", ONE), cluster(1, "b", TWO))
    assert question.chosen(question.parse("You decide")) == question.options[0]


@pytest.mark.parametrize("line", ["", "0", "3", "-1", "yes", "1 2"])
def test_other_lines_are_rejected(line: str) -> None:
    with pytest.raises(UserError, match='write 1, 2, "none" or "you decide"'):
        ask_about(cluster(2, "a", ONE), cluster(1, "b", TWO)).parse(line)
