"""Every sentence that explains a failure, word by word."""

import pytest

from codebotler.rtl import explain, parse
from codebotler.skills import SKILLS, Parameter, Recording, Skill
from codebotler.trace import Event, Option, Trace

WAVE = Skill("wave", (Parameter("person"),), "None", "Wave at a person.", Recording("wave", "person"))
WITH_WAVE = SKILLS.with_skill(WAVE)

YES_NO = (Option("yes"), Option("no"))
NOTHING: Trace = ()
LUNCH: Trace = (
    Event("goto", "alice's office"),
    Event("ask", "do you want lunch?", YES_NO),
    Event("goto", "bob's office"),
    Event("say", "hello bob"),
    Event("goto", "lobby"),
    Event("check", "person"),
    Event("say", "nobody is good"),
)
TWICE: Trace = (
    Event("goto", "lobby"),
    Event("say", "hi"),
    Event("goto", "lobby"),
    Event("goto", "kitchen"),
    Event("say", "tea"),
    Event("goto", "lobby"),
    Event("pick", "mug"),
    Event("say", "hi again"),
)
ODD: Trace = (
    Event("ask", "many?", tuple(Option(f"o{number}") for number in range(7))),
    Event("ask", "bare"),
    Event("wave", "bob"),
    Event("goto", "Room 7"),
    Event("goto", ""),
    Event("place", "red cup"),
    Event("goto", "the attic"),
    Event("say", "short"),
    Event("say", "two\nlines"),
)
OFTEN: Trace = (*(Event("goto", f"room {number}") for number in range(7)), *[Event("say", "a")] * 7)
LONG: Trace = (
    Event("goto", "x" * 80),
    Event("say", "x" * 70),
    Event("say", "y" * 71),
    Event("ask", "how many?", (Option("one"), Option("[2,\n 3]", is_text=False))),
)
CHAT: Trace = (
    Event("ask", "tea?", YES_NO),
    Event("ask", "tea or cake?", YES_NO),
    Event("ask", "cake?", YES_NO),
    Event("wave", "bob"),
    Event("say", "no cake"),
)


@pytest.mark.parametrize(
    ("trace", "text", "event", "sentence"),
    [
        (
            LUNCH,
            'tr.ActAtSome("lobby", say("tea"))',
            6,
            (
                'the robot went to the lobby at step 5 but did not say anything with "tea" there: it '
                'said "nobody is good" at step 7, which lacks "tea"'
            ),
        ),
        (
            LUNCH,
            'tr.ActAtFirst("kitchen", say("tea"))',
            None,
            (
                'the robot never went to the kitchen, where it was to say something with "tea": it '
                "only went to alice's office, bob's office and the lobby"
            ),
        ),
        (
            LUNCH,
            'tr.BeforeFirst(say("hello")).ActAtFirst("lobby", say("x"))',
            None,
            (
                'the robot never went to the lobby before saying "hello bob" at step 4, where it was '
                'to say something with "x": it did so only at step 5, too late'
            ),
        ),
        (
            LUNCH,
            'tr.AfterFirst(goto("kitchen")).Exists(say("x"))',
            3,
            (
                'the robot never went to the kitchen; it never said anything with "x": it said '
                '"hello bob" at step 4, which lacks "x"'
            ),
        ),
        (
            LUNCH,
            'tr.AfterFirst(goto("kitchen")).Exists(pick("x"))',
            None,
            'the robot never went to the kitchen; it never picked up "x"',
        ),
        (
            LUNCH,
            'tr.AfterFirst(goto("kitchen")).ActAtFirst("kitchen", say("x"))',
            None,
            (
                'the robot never went to the kitchen, where it was to say something with "x": it '
                "only went to alice's office, bob's office and the lobby"
            ),
        ),
        (
            LUNCH,
            'tr.AfterFirst(goto("kitchen")).ActAtFirst("lobby", say("x"))',
            6,
            (
                'the robot went to the lobby at step 5 but did not say anything with "x" there: it '
                'said "nobody is good" at step 7, which lacks "x"'
            ),
        ),
        (
            LUNCH,
            'tr.AfterFirst(goto("lobby")).AfterFirst(goto("alice")).Exists(pick("x"))',
            None,
            'the robot never picked up "x" after going to the lobby at step 5',
        ),
        (
            LUNCH,
            'tr.AfterFirst(goto("kitchen")).Count(check(".*"), 3)',
            None,
            "the robot looked around once (step 6) instead of 3 times",
        ),
        (
            LUNCH,
            'tr.Count(check(".*"),0)',
            5,
            'the robot looked for "person" at step 6, which it must not do',
        ),
        (LUNCH, 'tr.Count(pick("mug"),1)', None, 'the robot never picked up "mug"'),
        (LUNCH, 'tr.Count(pick("mug"),2)', None, 'the robot never picked up "mug", but it should have twice'),
        (LUNCH, 'tr.AtLeast(pick("mug"),1)', None, 'the robot never picked up "mug"'),
        (
            LUNCH,
            'tr.AfterFirst(goto("bob")).Count(say(".*"),1)',
            6,
            (
                "the robot said something twice (steps 4 and 7) after going to bob's office at step "
                "3 instead of once"
            ),
        ),
        (
            LUNCH,
            'tr.AtLeast(say(".*"),3)',
            None,
            "the robot said something twice (steps 4 and 7) instead of at least 3 times",
        ),
        (
            LUNCH,
            'tr.AfterFirst(goto("bob")).BeforeLast(say(".*")).Exists(pick("x"))',
            None,
            (
                'the robot never picked up "x" after going to bob\'s office at step 3 and before '
                'saying "nobody is good" at step 7'
            ),
        ),
        (
            LUNCH,
            'tr.AfterLast(goto(".*")).Exists(goto("bob"))',
            2,
            (
                "the robot never went to the bob after going to the lobby at step 5: it did so only "
                "at step 3, too early"
            ),
        ),
        (
            LUNCH,
            'tr.AfterLast(goto(".*")).Exists(goto("attic"))',
            None,
            "the robot never went to the attic after going to the lobby at step 5",
        ),
        (
            LUNCH,
            'not tr.AfterLast(goto(".*")).Exists(say(".*"))',
            6,
            (
                'the robot said "nobody is good" at step 7, which it must not do after going '
                "somewhere for the last time (step 5)"
            ),
        ),
        (
            LUNCH,
            'not tr.AfterLast(goto(".*")).Exists(check(".*"))',
            5,
            (
                'the robot looked for "person" at step 6, which it must not do after going somewhere '
                "for the last time (step 5)"
            ),
        ),
        (
            LUNCH,
            'not tr.AfterFirst(goto("attic")).Exists(check(".*"))',
            5,
            (
                'the robot looked for "person" at step 6, which it must not do (it never went to the '
                "attic, so every step counts)"
            ),
        ),
        (
            LUNCH,
            'not tr.AfterFirst(goto("attic")).BeforeFirst(goto("roof")).Exists(check(".*"))',
            5,
            (
                'the robot looked for "person" at step 6, which it must not do before going to the '
                "roof (which it never did)"
            ),
        ),
        (
            LUNCH,
            'not tr.AfterFirst(goto("bob")).BeforeFirst(goto("roof")).Exists(check(".*"))',
            5,
            (
                'the robot looked for "person" at step 6, which it must not do after going to the '
                "bob (step 3) and before going to the roof (which it never did)"
            ),
        ),
        (
            LUNCH,
            'not tr.AfterFirst(goto("bob")).BeforeLast(say(".*")).Exists(check(".*"))',
            5,
            (
                'the robot looked for "person" at step 6, which it must not do after going to the '
                "bob (step 3) and before saying something for the last time (step 7)"
            ),
        ),
        (
            LUNCH,
            'not tr.ActAtFirst("alice",ask("lunch","yes"))',
            1,
            (
                'the robot asked about lunch with an option with "yes" at step 2 after going to '
                'alice\'s office at step 1, which it must not do: it asked "do you want lunch?" with '
                'the options "yes" and "no"'
            ),
        ),
        (
            LUNCH,
            'not tr.ActAtSome("lobby",check(".*"))',
            5,
            (
                'the robot looked for "person" at step 6 after going to the lobby at step 5, which '
                "it must not do"
            ),
        ),
        (
            LUNCH,
            'not tr.ActAtSome("lobby",say("good"))',
            6,
            (
                'the robot said something with "good" at step 7 after going to the lobby at step 5, '
                'which it must not do: it said "nobody is good"'
            ),
        ),
        (
            LUNCH,
            'not tr.Count(say(".*"),2)',
            6,
            "the robot said something twice (steps 4 and 7), but it must not be exactly twice",
        ),
        (
            LUNCH,
            'not tr.AtLeast(say(".*"),2)',
            6,
            "the robot said something twice (steps 4 and 7), but it must be less than twice",
        ),
        (
            LUNCH,
            'not tr.AtLeast(say(".*"),0)',
            None,
            "anything happens at least 0 times, so this can never be satisfied",
        ),
        (LUNCH, 'not tr.Count(pick("mug"),0)', None, 'the robot never picked up "mug"'),
        (
            LUNCH,
            'not tr.AfterFirst(goto("bob")).Count(say(".*"),2)',
            6,
            (
                "the robot said something twice (steps 4 and 7) after going to bob's office at step "
                "3, but it must not be exactly twice"
            ),
        ),
        (
            LUNCH,
            'not tr.AfterFirst(goto("attic")).Count(say(".*"),2)',
            6,
            (
                "the robot said something twice (steps 4 and 7), but it must not be exactly twice "
                "(it never went to the attic, so every step counts)"
            ),
        ),
        (
            LUNCH,
            'not tr.AfterFirst(goto("attic")).BeforeFirst(goto("attic")).AtLeast(say(".*"),2)',
            6,
            (
                "the robot said something twice (steps 4 and 7), but it must be less than twice (it "
                "never went to the attic, so every step counts)"
            ),
        ),
        (
            LUNCH,
            'not not tr.Exists(say("x"))',
            3,
            ('the robot never said anything with "x": it said "hello bob" at step 4, which lacks "x"'),
        ),
        (
            LUNCH,
            'not (tr.Exists(say("hello")) or tr.Exists(pick("x")))',
            3,
            ('the robot said something with "hello" at step 4, which it must not do: it said "hello bob"'),
        ),
        (
            LUNCH,
            'not (tr.Exists(pick("x")) or tr.Exists(say("hello")))',
            3,
            ('the robot said something with "hello" at step 4, which it must not do: it said "hello bob"'),
        ),
        (
            LUNCH,
            'not (tr.Exists(say("hello")) and not tr.Exists(pick("x")))',
            3,
            ('the robot said "hello bob" at step 4 and never picked up "x", which must not both be so'),
        ),
        (
            LUNCH,
            (
                'not (tr.Exists(say("hello")) and not '
                'tr.AfterFirst(goto("lobby")).ActAtFirst("lobby",say("x")))'
            ),
            3,
            (
                'the robot said "hello bob" at step 4 and never went to the lobby after going to the '
                "lobby at step 5, which must not both be so"
            ),
        ),
        (
            LUNCH,
            ('not (tr.Count(say(".*"),2) and tr.Count(pick("x"),0) and tr.ActAtFirst("lobby",check(".*")))'),
            5,
            (
                'the robot said something twice (steps 4 and 7) and never picked up "x" and also '
                'looked for "person" at step 6 after going to the lobby at step 5, which must not '
                "all be so"
            ),
        ),
        (
            LUNCH,
            (
                'not (tr.AfterFirst(goto("bob")).Exists(say("hello")) and '
                'tr.AfterFirst(goto("bob")).Exists(check(".*")))'
            ),
            5,
            (
                'the robot said "hello bob" at step 4 and looked for "person" at step 6 after going '
                "to bob's office at step 3, which must not both be so"
            ),
        ),
        (
            LUNCH,
            ('not (tr.Exists(say("hello")) and (tr.Exists(say("zz")) or not not tr.Exists(check(".*"))))'),
            5,
            (
                'the robot said "hello bob" at step 4 and looked for "person" at step 6, which must '
                "not both be so"
            ),
        ),
        (
            LUNCH,
            ('not ((tr.Exists(say("hello")) and tr.Exists(check(".*"))) and tr.Exists(goto("lobby")))'),
            4,
            (
                'the robot said "hello bob" at step 4 and looked for "person" at step 6 and went to '
                "the lobby at step 5, which must not both be so"
            ),
        ),
        (
            LUNCH,
            'tr.Exists(pick("x")) or tr.Exists(say("x")) or tr.Exists(goto("x"))',
            3,
            (
                "one of 3 things had to be so, but none is; for one, the robot never said anything "
                'with "x": it said "hello bob" at step 4, which lacks "x"'
            ),
        ),
        (
            LUNCH,
            'tr.Exists(say("tea")) or tr.Exists(say("coffee"))',
            3,
            (
                'one of two things had to be so, but the robot never said anything with "coffee", '
                'and it never said anything with "tea": it said "hello bob" at step 4, which lacks '
                '"tea"'
            ),
        ),
        (
            LUNCH,
            'not tr.Exists(say("hello")) or tr.Exists(say("x"))',
            3,
            (
                'one of two things had to be so, but the robot never said anything with "x", and it '
                'said something with "hello" at step 4, which it must not do: it said "hello bob"'
            ),
        ),
        (
            LUNCH,
            '(tr.Exists(pick("x")) or tr.Exists(place("y"))) or tr.Exists(say("x"))',
            3,
            (
                "one of 3 things had to be so, but none is; for one, the robot never said anything "
                'with "x": it said "hello bob" at step 4, which lacks "x"'
            ),
        ),
        (
            LUNCH,
            'tr.Exists(pick("x")) or (tr.Exists(say("hello")) and tr.Exists(say("x")))',
            3,
            (
                'one of two things had to be so, but the robot never picked up "x", and it never '
                'said anything with "x": it said "hello bob" at step 4, which lacks "x"'
            ),
        ),
        (
            LUNCH,
            'tr.ActAtSome("alice",ask("tea",".*")) or tr.ActAtSome("alice",ask(".*","tea"))',
            1,
            (
                'the robot went to the alice at step 1 but did not mention "tea" in a question or '
                'its options there: it asked "do you want lunch?" at step 2, which lacks "tea", and '
                'none of its options ("yes" and "no") will do'
            ),
        ),
        (
            LUNCH,
            'tr.ActAtFirst("lobby",ask("tea",".*")) or tr.ActAtFirst("lobby",ask(".*","tea"))',
            4,
            (
                'the robot went to the lobby at step 5 but did not mention "tea" in a question or '
                "its options there: it only looked around and spoke"
            ),
        ),
        (
            LUNCH,
            'tr.Exists(ask("x",".*")) or tr.Exists(ask(".*",without("yes|no")))',
            1,
            (
                "one of two things had to be so, but the robot never asked anything with an option "
                'without the word "yes or no", and it never asked about x: it asked "do you want '
                'lunch?" at step 2, which lacks "x"'
            ),
        ),
        (
            LUNCH,
            'tr.Exists(ask(without("lunch"),".*")) or tr.Exists(ask(".*",without("yes|no")))',
            1,
            (
                "one of two things had to be so, but the robot never asked anything with an option "
                'without the word "yes or no", and it never asked anything without the word "lunch": '
                'it asked "do you want lunch?" at step 2, which has the word "lunch"'
            ),
        ),
        (
            LUNCH,
            'tr.Exists(ask(without("lunch"),".*"))',
            1,
            (
                'the robot never asked anything without the word "lunch": it asked "do you want '
                'lunch?" at step 2, which has the word "lunch"'
            ),
        ),
        (
            LUNCH,
            r'tr.Exists(say(r"^(?!nobody|hello\b)"))',
            3,
            (
                'the robot never said anything not starting with "nobody or hello": it said "hello '
                'bob" at step 4, which starts with "hello"'
            ),
        ),
        (
            LUNCH,
            r'tr.Exists(ask("x",r"\b(a|b)\b"))',
            1,
            (
                r'the robot never asked about x with an option matching /\b(a|b)\b/: it asked "do you '
                'want lunch?" at step 2, which lacks "x"'
            ),
        ),
        (
            LUNCH,
            'tr.Exists(say(words("bob", without("hello|hi"))))',
            3,
            (
                'the robot never said anything with "bob" and without the word "hello or hi": it '
                'said "hello bob" at step 4, which has the word "hello"'
            ),
        ),
        (
            LUNCH,
            'tr.Exists(goto(words("a","b")))',
            None,
            (
                'the robot never went to a room with "a" and "b": it only went to alice\'s office, '
                "bob's office and the lobby"
            ),
        ),
        (
            LUNCH,
            'tr.Exists(goto(without("lobby|.*office")))',
            None,
            (
                "the robot never went anywhere but to a room matching /lobby|.*office/: it only went "
                "to alice's office, bob's office and the lobby"
            ),
        ),
        (
            TWICE,
            'tr.ActAtFirst("lobby", say("tea"))',
            4,
            (
                'the robot went to the lobby at step 1 but did not say anything with "tea" during '
                "that stay: it did so only at step 5, after going to the kitchen at step 4"
            ),
        ),
        (
            TWICE,
            'tr.ActAtSome("lobby", say("tea"))',
            4,
            (
                'the robot went to the lobby at steps 1 and 6 but did not say anything with "tea" '
                "there: it did so only at step 5, after going to the kitchen at step 4"
            ),
        ),
        (
            TWICE,
            'tr.ActAtSome("lobby", place("tea"))',
            0,
            (
                'the robot went to the lobby at steps 1 and 6 but did not put down "tea" there: it '
                "only spoke and picked something up"
            ),
        ),
        (
            TWICE,
            'tr.ActAtFirst("kitchen", pick("mug"))',
            6,
            (
                'the robot went to the kitchen at step 4 but did not pick up "mug" there: it did so '
                "only at step 7, after going to the lobby at step 6"
            ),
        ),
        (
            TWICE,
            'not tr.ActAtSome("lobby", say("hi"))',
            1,
            (
                'the robot said something with "hi" at step 2 after going to the lobby at step 1, '
                'which it must not do: it said "hi"'
            ),
        ),
        (
            TWICE,
            'not tr.ActAtSome("lobby", pick("mug"))',
            6,
            ('the robot picked up "mug" at step 7 after going to the lobby at step 6, which it must not do'),
        ),
        (
            TWICE,
            'not tr.ActAtFirst("lobby", goto("lobby"))',
            2,
            (
                "the robot went to the lobby at step 3 after going to the lobby at step 1, which it "
                "must not do"
            ),
        ),
        (
            TWICE,
            ('tr.AfterFirst(goto("lobby")).BeforeLast(goto("lobby")).ActAtSome("lobby", pick("mug"))'),
            6,
            (
                "after going to the lobby at step 1, the robot went to the lobby at step 3 but did "
                'not pick up "mug" there before going to the lobby at step 6: it did so only at step '
                "7, too late"
            ),
        ),
        (
            TWICE,
            'tr.AfterLast(goto("lobby")).ActAtSome("lobby", say("hi"))',
            None,
            (
                "after going to the lobby at step 6, the robot never went to the lobby, where it was "
                'to say something with "hi": it did so only at steps 1, 3 and 6, too early'
            ),
        ),
        (
            TWICE,
            'tr.AfterFirst(goto("kitchen")).ActAtSome("lobby", say("bye"))',
            7,
            (
                "after going to the kitchen at step 4, the robot went to the lobby at step 6 but did "
                'not say anything with "bye" there: it said "hi again" at step 8, which lacks "bye"'
            ),
        ),
        (
            TWICE,
            'tr.BeforeLast(goto("lobby")).ActAtSome("lobby", say("bye"))',
            1,
            (
                'the robot went to the lobby at step 1 but did not say anything with "bye" there '
                'before going to the lobby at step 6: it said "hi" at step 2, which lacks "bye"'
            ),
        ),
        (
            TWICE,
            'tr.BeforeFirst(goto("kitchen")).Exists(say("tea"))',
            4,
            (
                'the robot never said anything with "tea" before going to the kitchen at step 4: it '
                "did so only at step 5, too late"
            ),
        ),
        (
            TWICE,
            'tr.AfterLast(goto("lobby")).Exists(say("tea"))',
            4,
            (
                'the robot never said anything with "tea" after going to the lobby at step 6: it did '
                "so only at step 5, too early"
            ),
        ),
        (
            TWICE,
            'tr.AfterFirst(goto("kitchen")).BeforeLast(goto("lobby")).Exists(say("hi"))',
            1,
            (
                'the robot never said anything with "hi" after going to the kitchen at step 4 and '
                "before going to the lobby at step 6: it did so only at steps 2 and 8"
            ),
        ),
        (
            TWICE,
            'tr.AfterFirst(goto("kitchen")).BeforeLast(goto("lobby")).Exists(pick("mug"))',
            6,
            (
                'the robot never picked up "mug" after going to the kitchen at step 4 and before '
                "going to the lobby at step 6: it did so only at step 7, too late"
            ),
        ),
        (
            TWICE,
            'tr.AfterFirst(goto("kitchen")).AfterFirst(goto("kitchen")).Exists(place("x"))',
            None,
            'the robot never put down "x" after going to the kitchen at step 4',
        ),
        (
            TWICE,
            'not tr.AfterLast(say("hi")).AtLeast(say(".*"),0)',
            None,
            "anything happens at least 0 times, so this can never be satisfied",
        ),
        (
            TWICE,
            'tr.AfterLast(say("hi")).AtLeast(say(".*"),1)',
            1,
            (
                'the robot never said anything after saying "hi again" at step 8: it did so only at '
                "steps 2, 5 and 8, too early"
            ),
        ),
        (
            TWICE,
            'not tr.AfterFirst(goto("lobby")).BeforeFirst(pick("mug")).Exists(say("hi"))',
            1,
            (
                'the robot said something with "hi" at step 2, which it must not do after going to '
                'the lobby (step 1) and before picking up "mug" (step 7): it said "hi"'
            ),
        ),
        (
            TWICE,
            'not tr.AfterLast(goto("lobby")).BeforeFirst(goto("kitchen")).Exists(pick("mug"))',
            6,
            (
                'the robot picked up "mug" at step 7, which it must not do after going to the lobby '
                "for the last time (step 6) and before going to the kitchen (which it did not do in "
                "that time)"
            ),
        ),
        (
            NOTHING,
            'tr.Exists(say("x"))',
            None,
            'the robot did nothing at all, so it never said anything with "x"',
        ),
        (
            NOTHING,
            'tr.ActAtSome("lobby", say("x"))',
            None,
            "the robot did nothing at all, so it never went to the lobby",
        ),
        (
            NOTHING,
            'tr.Count(say("x"),2)',
            None,
            ('the robot did nothing at all, so it never said anything with "x", but it should have twice'),
        ),
        (
            NOTHING,
            'tr.AtLeast(say("x"),1)',
            None,
            'the robot did nothing at all, so it never said anything with "x"',
        ),
        (
            NOTHING,
            'not tr.Count(say("x"),0)',
            None,
            'the robot did nothing at all, so it never said anything with "x"',
        ),
        (
            NOTHING,
            'tr.AfterFirst(goto("k")).Exists(say("x"))',
            None,
            'the robot did nothing at all, so it never said anything with "x"',
        ),
        (
            NOTHING,
            'not not tr.Exists(goto(".*"))',
            None,
            "the robot did nothing at all, so it never went anywhere",
        ),
        (
            NOTHING,
            'not (not tr.Exists(say("x")) and not tr.Exists(say("y")))',
            None,
            (
                'the robot did nothing at all, so it never said anything with "x" and did nothing at '
                'all, so it never said anything with "y", which must not both be so'
            ),
        ),
        (
            ODD,
            'tr.Exists(ask("many","x"))',
            0,
            (
                'the robot never asked about many with an option with "x": it asked "many?" at step '
                '1, but none of its options ("o0", "o1", "o2", "o3", "o4" and 2 more) has "x"'
            ),
        ),
        (
            ODD,
            'tr.Exists(ask("bare","x"))',
            1,
            (
                'the robot never asked about bare with an option with "x": it asked "bare" at step '
                "2, which does not count without options"
            ),
        ),
        (
            ODD,
            'tr.Exists(ask("bare",".*"))',
            1,
            (
                'the robot never asked about bare: it asked "bare" at step 2, which does not count '
                "without options"
            ),
        ),
        (
            ODD,
            'tr.Exists(goto("kitchen"))',
            None,
            'the robot never went to the kitchen: it only went to Room 7, "" and the attic',
        ),
        (
            ODD,
            'tr.Exists(goto(".*")) and tr.Exists(goto("^$x"))',
            None,
            ('the robot never went to a room matching /^$x/: it only went to Room 7, "" and the attic'),
        ),
        (
            ODD,
            'tr.Exists(say("yy"))',
            7,
            'the robot never said anything with "yy": it said "short" at step 8, which lacks "yy"',
        ),
        (
            ODD,
            'not tr.Exists(say("lines"))',
            8,
            ('the robot said something with "lines" at step 9, which it must not do: it said "two lines"'),
        ),
        (
            ODD,
            'not tr.Exists(ask("many","o1"))',
            0,
            (
                'the robot asked about many with an option with "o1" at step 1, which it must not '
                'do: it asked "many?" with the options "o0", "o1", "o2", "o3", "o4" and 2 more'
            ),
        ),
        (
            ODD,
            'tr.ActAtFirst("7",check(".*"))',
            3,
            ("the robot went to Room 7 at step 4 but did not look around there: it did nothing there"),
        ),
        (
            ODD,
            'tr.ActAtFirst("attic",place("cup|pot"))',
            5,
            (
                'the robot went to the attic at step 7 but did not put down "cup or pot" there: it '
                'did so only at step 6, after going to "" at step 5'
            ),
        ),
        (
            ODD,
            'tr.ActAtFirst("attic",place(".*x"))',
            6,
            (
                "the robot went to the attic at step 7 but did not put down anything matching /.*x/ "
                "there: it only spoke"
            ),
        ),
        (
            ODD,
            'tr.Exists(place(words("a|b",without("c"))))',
            5,
            (
                'the robot never put down anything with "a or b" and without the word "c": it put '
                'down "red cup" at step 6, which lacks "a or b"'
            ),
        ),
        (
            ODD,
            'tr.Exists(check(without("a")))',
            None,
            'the robot never looked for anything without the word "a"',
        ),
        (
            ODD,
            'tr.Exists(check(words("a","b")))',
            None,
            'the robot never looked for anything with "a" and "b"',
        ),
        (
            ODD,
            'not tr.Exists(goto(without("lobby")))',
            3,
            "the robot went to Room 7 at step 4, which it must not do",
        ),
        (
            ODD,
            'not tr.AfterFirst(goto(without("lobby"))).Exists(say(".*"))',
            7,
            (
                'the robot said "short" at step 8, which it must not do after going elsewhere than '
                "to the lobby (step 4)"
            ),
        ),
        (
            ODD,
            'not tr.AfterFirst(goto(".*")).Exists(say(".*"))',
            7,
            ('the robot said "short" at step 8, which it must not do after going somewhere (step 4)'),
        ),
        (
            ODD,
            'tr.Exists(ask("bare",".*")) or tr.Exists(ask(".*","bara"))',
            1,
            (
                "one of two things had to be so, but the robot never asked anything with an option "
                'with "bara", and it never asked about bare: it asked "bare" at step 2, which does '
                "not count without options"
            ),
        ),
        (
            ODD,
            'tr.Exists(ask(without("many"),".*")) and tr.Exists(ask("zzz",".*"))',
            1,
            (
                'the robot never asked anything without the word "many": it asked "bare" at step 2, '
                "which does not count without options"
            ),
        ),
        (
            ODD,
            'tr.Exists(ask(words("bare","u"),".*")) or tr.Exists(ask(".*",words("bare","u")))',
            1,
            (
                'the robot never mentioned "bare" and "u" in a question or its options: it asked '
                '"bare" at step 2, which lacks "u", and it had no options'
            ),
        ),
        (
            ODD,
            (
                'tr.BeforeFirst(say(".*")).Exists(ask(without("many|bare"),"o")) or '
                'tr.BeforeFirst(say(".*")).Exists(ask("o",without("many|bare")))'
            ),
            0,
            (
                "one of two things had to be so, but the robot never asked about o with an option "
                'without the word "many or bare" before saying "short" at step 8, and it never asked '
                'anything without the word "many or bare" with an option with "o" before saying '
                '"short" at step 8: it asked "many?" at step 1, which has the word "many"'
            ),
        ),
        (
            ODD,
            r'tr.Exists(say(words(r"\bno\b", r"\b(a|b)\b",r"a.b","^x|y")))',
            7,
            (
                r'the robot never said anything with the word "no", matching /\b(a|b)\b/, matching '
                '/a.b/ and matching /^x|y/: it said "short" at step 8, which lacks the word "no", '
                r"does not match /\b(a|b)\b/, does not match /a.b/ and does not match /^x|y/"
            ),
        ),
        (
            ODD,
            'not tr.BeforeFirst(say(".*")).BeforeFirst(say("two")).Exists(place("cup"))',
            5,
            (
                'the robot put down "red cup" at step 6, which it must not do before saying '
                'something (step 8) and before saying something with "two" (which it did not do in '
                "that time)"
            ),
        ),
        (
            ODD,
            'tr.Exists(say(words("x","y","zz")))',
            7,
            (
                'the robot never said anything with "x", "y" and "zz": it said "short" at step 8, '
                'which lacks "x", "y" and "zz"'
            ),
        ),
        (
            ODD,
            r'tr.Exists(say(r"a\.b"))',
            7,
            ('the robot never said anything with "a.b": it said "short" at step 8, which lacks "a.b"'),
        ),
        (
            ODD,
            r'tr.Exists(say("a\nb"))',
            7,
            ('the robot never said anything with "a b": it said "short" at step 8, which lacks "a b"'),
        ),
        (
            ODD,
            'tr.Exists(goto("a |b"))',
            None,
            ('the robot never went to a room matching /a |b/: it only went to Room 7, "" and the attic'),
        ),
        (
            ODD,
            'not not tr.Count(say(".*"),7)',
            None,
            "the robot said something twice (steps 8 and 9) instead of 7 times",
        ),
        (
            ODD,
            'not (tr.Exists(say(".*")) and not tr.Count(say(".*"),7))',
            8,
            (
                'the robot said "short" at step 8 and said something twice (steps 8 and 9), which '
                "must not both be so"
            ),
        ),
        (
            ODD,
            'not (tr.Exists(say(".*")) and not tr.Count(say(".*"),0))',
            7,
            ('the robot said "short" at step 8 and said "short" at step 8, which must not both be so'),
        ),
        (
            ODD,
            'not (tr.Exists(say(".*")) and not (tr.Exists(pick("a")) or tr.Count(say(".*"),1)))',
            7,
            (
                'the robot said "short" at step 8 and never picked up "a" and said something twice '
                "(steps 8 and 9), which must not both be so"
            ),
        ),
        (
            ODD,
            ('not (tr.Exists(say(".*")) and not (tr.Exists(say(".*")) and not tr.Exists(place(".*"))))'),
            5,
            ('the robot said "short" at step 8 and put down "red cup" at step 6, which must not both be so'),
        ),
        (
            ODD,
            'not (tr.Exists(say(".*")) and not tr.AtLeast(say(".*"),7))',
            8,
            (
                'the robot said "short" at step 8 and said something twice (steps 8 and 9), which '
                "must not both be so"
            ),
        ),
        (
            ODD,
            'not (tr.Exists(say(".*")) and not tr.ActAtFirst("attic",say("q")))',
            7,
            (
                'the robot said "short" at step 8 and went to the attic at step 7 but did not say '
                'anything with "q" there, which must not both be so'
            ),
        ),
        (
            ODD,
            ('not (tr.Exists(say(".*")) and not tr.AfterFirst(goto("7")).ActAtFirst("attic",say("q")))'),
            7,
            (
                'the robot said "short" at step 8 and acted so that after going to Room 7 at step 4, '
                'the robot went to the attic at step 7 but did not say anything with "q" there, '
                "which must not both be so"
            ),
        ),
        (
            ODD,
            ('not (tr.Exists(say(".*")) and not (tr.Exists(ask("q",".*")) or tr.Exists(ask(".*","q"))))'),
            7,
            (
                'the robot said "short" at step 8 and never mentioned "q" in a question or its '
                "options, which must not both be so"
            ),
        ),
        (ODD, 'not tr.AtLeast(say(".*"),1)', 7, 'the robot said "short" at step 8, which it must not do'),
        (
            ODD,
            'not tr.AfterFirst(say("x")).AtLeast(say(".*"),1)',
            7,
            (
                'the robot said "short" at step 8, which it must not do (it never said anything with '
                '"x", so every step counts)'
            ),
        ),
        (
            ODD,
            'tr.Count(say(".*"),1) or tr.Exists(pick("x"))',
            8,
            (
                'one of two things had to be so, but the robot never picked up "x", and it said '
                "something twice (steps 8 and 9) instead of once"
            ),
        ),
        (
            ODD,
            '(tr.Exists(ask("q",".*")) or tr.Exists(ask(".*","q"))) or tr.Exists(pick("a"))',
            0,
            (
                'one of two things had to be so, but the robot never picked up "a", and it never '
                'mentioned "q" in a question or its options: it asked "many?" at step 1, which lacks '
                '"q", and none of its options ("o0", "o1", "o2", "o3", "o4" and 2 more) will do'
            ),
        ),
        (
            ODD,
            'tr.Count(goto("zz"), 3)',
            None,
            (
                "the robot never went to the zz, but it should have 3 times: it only went to Room 7, "
                '"" and the attic'
            ),
        ),
        (
            OFTEN,
            'tr.Exists(goto("x"))',
            None,
            (
                "the robot never went to the x: it only went to room 0, room 1, room 2, room 3, room "
                "4 and 2 more rooms"
            ),
        ),
        (
            OFTEN,
            'tr.Count(say("a"),2)',
            9,
            (
                'the robot said something with "a" 7 times (steps 8, 9, 10, 11, 12 and 2 more) '
                "instead of twice"
            ),
        ),
        (
            OFTEN,
            'not tr.AtLeast(say("a"),2)',
            8,
            (
                'the robot said something with "a" 7 times (steps 8, 9, 10, 11, 12 and 2 more), but '
                "it must be less than twice"
            ),
        ),
        (
            OFTEN,
            'tr.ActAtSome("8",say("q"))',
            None,
            (
                'the robot never went to 8, where it was to say something with "q": it only went to '
                "room 0, room 1, room 2, room 3, room 4 and 2 more rooms"
            ),
        ),
        (
            OFTEN,
            'tr.ActAtSome("room",say("b"))',
            7,
            (
                'the robot went to the room at step 1 but did not say anything with "b" there: it '
                'said "a" at step 8, which lacks "b"'
            ),
        ),
        (
            OFTEN,
            'tr.ActAtSome("3|5",say("b"))',
            3,
            (
                'the robot went to 3 or 5 at steps 4 and 6 but did not say anything with "b" there: '
                "it did nothing there"
            ),
        ),
        (
            OFTEN,
            'tr.ActAtSome("3",pick("b"))',
            3,
            'the robot went to 3 at step 4 but did not pick up "b" there: it did nothing there',
        ),
        (
            LONG,
            'tr.Exists(say("z"))',
            1,
            (
                'the robot never said anything with "z": it said '
                '"xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx" at step 2, '
                'which lacks "z"'
            ),
        ),
        (
            LONG,
            'not tr.Exists(say("x"))',
            1,
            (
                'the robot said something with "x" at step 2, which it must not do: it said '
                '"xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"'
            ),
        ),
        (
            LONG,
            'not tr.Exists(say("y"))',
            2,
            (
                'the robot said something with "y" at step 3, which it must not do: it said '
                '"yyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyyy…"'
            ),
        ),
        (
            LONG,
            'tr.Exists(goto("z"))',
            None,
            (
                "the robot never went to the z: it only went to the "
                "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx…"
            ),
        ),
        (
            LONG,
            'not tr.Exists(goto("x"))',
            0,
            (
                "the robot went to the "
                "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx… at step 1, "
                "which it must not do"
            ),
        ),
        (
            LONG,
            r'tr.Exists(say("a\nb"))',
            1,
            (
                'the robot never said anything with "a b": it said '
                '"xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx" at step 2, '
                'which lacks "a b"'
            ),
        ),
        (
            LONG,
            'tr.Exists(ask("many","x"))',
            3,
            (
                "option 2 of the question at step 4 is no text but [2, 3], so what was required "
                "cannot be judged"
            ),
        ),
        (
            LONG,
            'not tr.Exists(ask("many","two"))',
            3,
            (
                "option 2 of the question at step 4 is no text but [2, 3], so what was required "
                "cannot be judged"
            ),
        ),
        (
            LONG,
            'tr.Exists(say("z")) or not (tr.Exists(pick("z")) or tr.Exists(ask("many","x")))',
            3,
            (
                "option 2 of the question at step 4 is no text but [2, 3], so what was required "
                "cannot be judged"
            ),
        ),
        (
            LONG,
            'not tr.Exists(ask("many","one"))',
            3,
            (
                'the robot asked about many with an option with "one" at step 4, which it must not '
                'do: it asked "how many?" with the options "one" and "[2, 3]"'
            ),
        ),
        (
            LONG,
            ('tr.Count(ask("many","one|2"),1) and tr.AfterFirst(ask("how","one")).Exists(pick("z"))'),
            None,
            'the robot never picked up "z" after asking "how many?" at step 4',
        ),
        (
            LONG,
            'tr.Exists(goto("x")) and tr.Exists(ask("a","b")) and tr.Exists(say("z"))',
            3,
            (
                "option 2 of the question at step 4 is no text but [2, 3], so what was required "
                "cannot be judged"
            ),
        ),
        (
            LONG,
            'tr.AfterFirst(pick("a")).AfterFirst(ask("x","two")).Exists(say("b"))',
            3,
            (
                "option 2 of the question at step 4 is no text but [2, 3], so what was required "
                "cannot be judged"
            ),
        ),
        (
            CHAT,
            'tr.Exists(ask(words("tea","coffee"),".*"))',
            0,
            (
                'the robot never asked anything with "tea" and "coffee": it asked "tea?" at step 1, '
                'which lacks "coffee"'
            ),
        ),
        (
            CHAT,
            'tr.Exists(ask(words("cake","coffee"),".*"))',
            1,
            (
                'the robot never asked anything with "cake" and "coffee": it asked "tea or cake?" at '
                'step 2, which lacks "coffee"'
            ),
        ),
        (
            CHAT,
            'tr.Exists(ask(words("tea","cake","coffee"),".*"))',
            1,
            (
                'the robot never asked anything with "tea", "cake" and "coffee": it asked "tea or '
                'cake?" at step 2, which lacks "coffee"'
            ),
        ),
        (
            CHAT,
            (
                'tr.Exists(ask(words("tea","cake","coffee"),".*")) or '
                'tr.Exists(ask(".*",words("tea","cake","coffee")))'
            ),
            1,
            (
                'the robot never mentioned "tea", "cake" and "coffee" in a question or its options: '
                'it asked "tea or cake?" at step 2, which lacks "coffee", and none of its options '
                '("yes" and "no") will do'
            ),
        ),
        (
            CHAT,
            'tr.Exists(ask(".*","maybe"))',
            0,
            (
                'the robot never asked anything with an option with "maybe": it asked "tea?" at step '
                '1, but none of its options ("yes" and "no") has "maybe"'
            ),
        ),
        (
            CHAT,
            'tr.Exists(ask(".*",without("yes|no")))',
            0,
            (
                'the robot never asked anything with an option without the word "yes or no": it '
                'asked "tea?" at step 1, but none of its options ("yes" and "no") is one without the '
                'word "yes or no"'
            ),
        ),
        (
            CHAT,
            'tr.Exists(ask(".*",words("yes","no")))',
            0,
            (
                'the robot never asked anything with an option with "yes" and "no": it asked "tea?" '
                'at step 1, but none of its options ("yes" and "no") has "yes" and "no"'
            ),
        ),
        (
            CHAT,
            'tr.Exists(wave("alice"))',
            3,
            ('the robot never did a wave with "alice": it did a wave "bob" at step 4, which lacks "alice"'),
        ),
        (CHAT, 'not tr.Exists(wave("bob"))', 3, 'the robot did a wave "bob" at step 4, which it must not do'),
        (
            CHAT,
            'not tr.AfterFirst(wave(".*")).Exists(say("cake"))',
            4,
            (
                'the robot said something with "cake" at step 5, which it must not do after doing a '
                'wave (step 4): it said "no cake"'
            ),
        ),
        (CHAT, 'not tr.Exists(wave(".*"))', 3, 'the robot did a wave "bob" at step 4, which it must not do'),
        (
            CHAT,
            'not tr.AtLeast(wave(".*"),1)',
            3,
            'the robot did a wave "bob" at step 4, which it must not do',
        ),
        (
            CHAT,
            'not tr.Count(wave("bob"),1)',
            3,
            'the robot did a wave with "bob" once (step 4), but it must not be exactly once',
        ),
        (
            CHAT,
            'tr.AfterFirst(wave("bob")).Exists(say("tea"))',
            4,
            (
                'the robot never said anything with "tea" after doing a wave "bob" at step 4: it '
                'said "no cake" at step 5, which lacks "tea"'
            ),
        ),
        (
            CHAT,
            'tr.ActAtFirst("hall",wave("bob"))',
            None,
            ('the robot never went to the hall, where it was to do a wave with "bob": it went nowhere'),
        ),
        (
            CHAT,
            'tr.ActAtFirst("hall",wave(".*"))',
            None,
            "the robot never went to the hall, where it was to do a wave: it went nowhere",
        ),
        (
            CHAT,
            'tr.ActAtFirst("hall",ask(".*",".*"))',
            None,
            "the robot never went to the hall, where it was to ask a question: it went nowhere",
        ),
        (
            CHAT,
            'tr.ActAtFirst("hall",check(".*"))',
            None,
            "the robot never went to the hall, where it was to look around: it went nowhere",
        ),
        (
            CHAT,
            'tr.ActAtFirst("hall",check("cat|dog"))',
            None,
            ('the robot never went to the hall, where it was to look for "cat or dog": it went nowhere'),
        ),
        (
            CHAT,
            'tr.ActAtFirst("hall",pick(".*"))',
            None,
            "the robot never went to the hall, where it was to pick up something: it went nowhere",
        ),
        (
            CHAT,
            'tr.ActAtFirst("hall",place(".*"))',
            None,
            ("the robot never went to the hall, where it was to put down something: it went nowhere"),
        ),
        (
            CHAT,
            'tr.ActAtFirst("hall",say(".*"))',
            None,
            "the robot never went to the hall, where it was to say something: it went nowhere",
        ),
        (
            CHAT,
            'tr.ActAtFirst("hall",goto("den"))',
            None,
            "the robot never went to the hall, where it was to go to the den: it went nowhere",
        ),
        (
            CHAT,
            'tr.ActAtFirst("hall",goto(".*"))',
            None,
            "the robot never went to the hall, where it was to go somewhere: it went nowhere",
        ),
        (
            CHAT,
            'tr.ActAtFirst("hall",goto(without("den")))',
            None,
            (
                "the robot never went to the hall, where it was to go elsewhere than to the den: it "
                "went nowhere"
            ),
        ),
        (
            CHAT,
            'tr.ActAtFirst("hall",goto(words("a","b")))',
            None,
            (
                'the robot never went to the hall, where it was to go to a room with "a" and "b": it '
                "went nowhere"
            ),
        ),
        (CHAT, 'tr.Exists(goto("hall"))', None, "the robot never went to the hall: it went nowhere"),
        (CHAT, 'tr.Exists(goto(".*"))', None, "the robot never went anywhere"),
        (
            CHAT,
            'tr.Exists(say("tea"))',
            4,
            ('the robot never said anything with "tea": it said "no cake" at step 5, which lacks "tea"'),
        ),
        (
            CHAT,
            r'tr.Exists(say(r"^(?!(no|yes)\b)"))',
            4,
            (
                r'the robot never said anything matching /^(?!(no|yes)\b)/: it said "no cake" at step '
                "5, which does not match"
            ),
        ),
        (
            CHAT,
            r'tr.Exists(say(r"^(?!no|yes\b)"))',
            4,
            (
                'the robot never said anything not starting with "no or yes": it said "no cake" at '
                'step 5, which starts with "no"'
            ),
        ),
        (
            CHAT,
            'tr.Exists(say(without("no|cake")))',
            4,
            (
                'the robot never said anything without the word "no or cake": it said "no cake" at '
                'step 5, which has the word "no"'
            ),
        ),
        (
            CHAT,
            r'tr.Exists(say(r"\bcak\b"))',
            4,
            (
                'the robot never said anything with the word "cak": it said "no cake" at step 5, '
                'which lacks the word "cak"'
            ),
        ),
        (
            CHAT,
            r'tr.Exists(say(r"\b(?:tea|pie)\b"))',
            4,
            (
                'the robot never said anything with the word "tea or pie": it said "no cake" at step '
                '5, which lacks the word "tea or pie"'
            ),
        ),
        (
            CHAT,
            'tr.Exists(say(words("cake","tea","pie",without("no"))))',
            4,
            (
                'the robot never said anything with "cake", "tea" and "pie" and without the word '
                '"no": it said "no cake" at step 5, which lacks "tea" and "pie" and has the word "no"'
            ),
        ),
        (
            CHAT,
            'tr.Exists(say(words(".*","^$")))',
            4,
            (
                'the robot never said anything matching /^$/: it said "no cake" at step 5, which '
                "does not match"
            ),
        ),
        (
            CHAT,
            (
                "not "
                'tr.AfterFirst(ask("tea",".*")).BeforeFirst(say(words("no",".*"))).Exists(wave(words(".*","")))'
            ),
            3,
            (
                'the robot did a wave "bob" at step 4, which it must not do after asking about tea '
                '(step 1) and before saying something with "no" (step 5)'
            ),
        ),
        (
            CHAT,
            'not tr.AfterFirst(check(".*")).Exists(ask(".*",".*"))',
            0,
            (
                "the robot asked a question at step 1, which it must not do (it never looked around, "
                'so every step counts): it asked "tea?" with the options "yes" and "no"'
            ),
        ),
        (
            CHAT,
            'not tr.AfterFirst(check("cat")).Count(ask(".*",".*"),3)',
            2,
            (
                "the robot asked a question 3 times (steps 1, 2 and 3), but it must not be exactly 3 "
                'times (it never looked for "cat", so every step counts)'
            ),
        ),
        (
            CHAT,
            'not tr.BeforeFirst(check(".*")).Exists(ask(".*","yes"))',
            0,
            (
                'the robot asked a question with an option with "yes" at step 1, which it must not '
                'do before looking around (which it never did): it asked "tea?" with the options '
                '"yes" and "no"'
            ),
        ),
        (
            CHAT,
            'not tr.BeforeFirst(pick("a|b")).Exists(say(".*"))',
            4,
            (
                'the robot said "no cake" at step 5, which it must not do before picking up "a or b" '
                "(which it never did)"
            ),
        ),
        (
            CHAT,
            'not tr.BeforeFirst(place("a|b")).AtLeast(say(".*"),1)',
            4,
            (
                'the robot said "no cake" at step 5, which it must not do before putting down "a or '
                'b" (which it never did)'
            ),
        ),
        (
            CHAT,
            (
                'tr.BeforeFirst(wave(".*")).Exists(ask("x",".*")) or '
                'tr.BeforeFirst(wave(".*")).Exists(ask(".*","x"))'
            ),
            0,
            (
                'the robot never mentioned "x" in a question or its options before doing a wave '
                '"bob" at step 4: it asked "tea?" at step 1, which lacks "x", and none of its '
                'options ("yes" and "no") will do'
            ),
        ),
        (
            CHAT,
            'tr.BeforeFirst(wave(".*")).Exists(ask("x",".*")) or tr.Exists(ask(".*","x"))',
            0,
            (
                "one of two things had to be so, but the robot never asked anything with an option "
                'with "x", and it never asked about x before doing a wave "bob" at step 4: it asked '
                '"tea?" at step 1, which lacks "x"'
            ),
        ),
        (
            CHAT,
            'tr.Exists(ask("x",".*")) or tr.AtLeast(ask(".*","x"),1)',
            0,
            (
                "one of two things had to be so, but the robot never asked anything with an option "
                'with "x", and it never asked about x: it asked "tea?" at step 1, which lacks "x"'
            ),
        ),
        (
            CHAT,
            'tr.ActAtSome("a",ask("x",".*")) or tr.ActAtSome("b",ask(".*","x"))',
            None,
            (
                "one of two things had to be so, but the robot never went to the b, where it was to "
                'ask a question with an option with "x", and it never went to the a, where it was to '
                "ask about x: it went nowhere"
            ),
        ),
        (
            CHAT,
            'tr.Exists(ask("x","y")) or tr.Exists(ask("y","x"))',
            0,
            (
                "one of two things had to be so, but the robot never asked about y with an option "
                'with "x", and it never asked about x with an option with "y": it asked "tea?" at '
                'step 1, which lacks "x"'
            ),
        ),
        (
            CHAT,
            'tr.Exists(ask(".*","x")) or tr.Exists(ask("x",".*"))',
            0,
            (
                'the robot never mentioned "x" in a question or its options: it asked "tea?" at step '
                '1, which lacks "x", and none of its options ("yes" and "no") will do'
            ),
        ),
        (
            CHAT,
            'tr.Exists(ask(without("tea|cake"),".*")) or tr.Exists(ask(".*",without("yes|no|x")))',
            0,
            (
                "one of two things had to be so, but the robot never asked anything with an option "
                'without the word "yes, no or x", and it never asked anything without the word "tea '
                'or cake": it asked "tea?" at step 1, which has the word "tea"'
            ),
        ),
        (
            CHAT,
            'tr.Exists(ask(r"x{3}",".*")) or tr.Exists(ask(".*",r"x{3}"))',
            0,
            (
                "the robot never asked a question or offered an option matching /x{3}/: it asked "
                '"tea?" at step 1, which does not match, and none of its options ("yes" and "no") '
                "will do"
            ),
        ),
        (
            CHAT,
            'tr.ActAtFirst("hall",ask(r"x{3}",".*")) or tr.ActAtFirst("hall",ask(".*",r"x{3}"))',
            None,
            (
                "the robot never went to the hall, where it was to ask a question or offer an option "
                "matching /x{3}/: it went nowhere"
            ),
        ),
        (
            CHAT,
            'tr.ActAtFirst("hall",ask(r"x",".*")) or tr.ActAtFirst("hall",ask(".*",r"x"))',
            None,
            (
                'the robot never went to the hall, where it was to mention "x" in a question or its '
                "options: it went nowhere"
            ),
        ),
        (
            CHAT,
            (
                'not (tr.Exists(ask("tea",".*")) and not (tr.Exists(ask("x",".*")) or '
                'tr.Exists(ask(".*","x"))))'
            ),
            0,
            (
                'the robot asked "tea?" at step 1 and never mentioned "x" in a question or its '
                "options, which must not both be so"
            ),
        ),
        (
            CHAT,
            'not (tr.Exists(pick("a")) or tr.Exists(ask("x",".*")) or tr.Exists(say("cake")))',
            4,
            ('the robot said something with "cake" at step 5, which it must not do: it said "no cake"'),
        ),
        (
            CHAT,
            (
                'tr.Exists(pick("a")) or (tr.Exists(place("b")) or (tr.Exists(check("c")) or '
                'tr.Exists(say("d"))))'
            ),
            4,
            (
                "one of 4 things had to be so, but none is; for one, the robot never said anything "
                'with "d": it said "no cake" at step 5, which lacks "d"'
            ),
        ),
        (
            CHAT,
            'not (tr.Exists(say("cake")) and (tr.Exists(pick("a")) or tr.Exists(wave("bob"))))',
            3,
            ('the robot said "no cake" at step 5 and did a wave "bob" at step 4, which must not both be so'),
        ),
        (
            CHAT,
            'tr.AtLeast(say(".*"),2)',
            None,
            "the robot said something once (step 5) instead of at least twice",
        ),
        (CHAT, 'tr.Count(say(".*"),2)', None, "the robot said something once (step 5) instead of twice"),
        (CHAT, 'tr.Count(say(".*"),0)', 4, 'the robot said "no cake" at step 5, which it must not do'),
        (
            CHAT,
            'tr.Count(ask(".*",".*"),2)',
            2,
            "the robot asked a question 3 times (steps 1, 2 and 3) instead of twice",
        ),
        (
            CHAT,
            'tr.Count(ask("tea",".*"),1)',
            1,
            "the robot asked about tea twice (steps 1 and 2) instead of once",
        ),
        (
            CHAT,
            'not tr.AtLeast(ask(".*",".*"),2)',
            1,
            ("the robot asked a question 3 times (steps 1, 2 and 3), but it must be less than twice"),
        ),
        (
            CHAT,
            'not tr.Count(ask(".*",".*"),3)',
            2,
            ("the robot asked a question 3 times (steps 1, 2 and 3), but it must not be exactly 3 times"),
        ),
        (
            CHAT,
            'tr.AtLeast(pick("a"),2)',
            None,
            'the robot never picked up "a", but it should have at least twice',
        ),
        (
            CHAT,
            'tr.AtLeast(pick("a"),3)',
            None,
            'the robot never picked up "a", but it should have at least 3 times',
        ),
        (
            CHAT,
            'tr.BeforeFirst(wave(".*")).AtLeast(say("cake"),2)',
            4,
            (
                'the robot never said anything with "cake" before doing a wave "bob" at step 4, but '
                "it should have at least twice: it did so only at step 5, too late"
            ),
        ),
        (
            CHAT,
            'tr.BeforeFirst(wave(".*")).Count(say("soup"),2)',
            None,
            (
                'the robot never said anything with "soup" before doing a wave "bob" at step 4, but '
                "it should have twice"
            ),
        ),
        (
            TWICE,
            'tr.BeforeFirst(goto("kitchen")).ActAtSome("lobby",say("tea"))',
            4,
            (
                'the robot went to the lobby at step 1 but did not say anything with "tea" there '
                "before going to the kitchen at step 4: it did so only at step 5, too late"
            ),
        ),
        (
            TWICE,
            'tr.BeforeFirst(goto("kitchen")).ActAtSome("lobby",place("cup"))',
            0,
            (
                'the robot went to the lobby at step 1 but did not put down "cup" there before going '
                "to the kitchen at step 4: it only spoke"
            ),
        ),
        (
            TWICE,
            (
                'tr.AfterFirst(goto("lobby")).AfterFirst(goto("kitchen")).Exists(say("hi "))and '
                'tr.BeforeLast(say("hi")).BeforeLast(goto("lobby")).Exists(pick("mug"))'
            ),
            6,
            (
                'the robot never picked up "mug" before going to the lobby at step 6: it did so only '
                "at step 7, too late"
            ),
        ),
        (
            TWICE,
            'not tr.BeforeLast(say("hi")).BeforeLast(goto("lobby")).Exists(say("tea"))',
            4,
            (
                'the robot said something with "tea" at step 5, which it must not do before saying '
                'something with "hi" for the last time (step 8) and before going to the lobby for '
                'the last time (step 6): it said "tea"'
            ),
        ),
        (
            TWICE,
            'not (tr.ActAtFirst("lobby",say("hi")) and tr.ActAtSome("lobby",pick("mug")))',
            6,
            (
                'the robot said "hi" at step 2 after going to the lobby at step 1 and also picked up '
                '"mug" at step 7 after going to the lobby at step 6, which must not both be so'
            ),
        ),
        (
            TWICE,
            'not (tr.Exists(say("tea")) and not tr.ActAtFirst("attic",say("x")))',
            4,
            ('the robot said "tea" at step 5 and never went to the attic, which must not both be so'),
        ),
        (
            TWICE,
            'tr.AfterFirst(pick("cup")).ActAtFirst("lobby",say("tea"))',
            4,
            (
                'the robot went to the lobby at step 1 but did not say anything with "tea" during '
                "that stay: it did so only at step 5, after going to the kitchen at step 4"
            ),
        ),
        (
            TWICE,
            'tr.AfterFirst(pick("cup")).ActAtFirst("attic",say("tea"))',
            None,
            (
                'the robot never picked up "cup"; it never went to the attic, where it was to say '
                'something with "tea": it only went to the lobby and the kitchen'
            ),
        ),
        (
            TWICE,
            'tr.AfterFirst(goto("attic")).ActAtFirst("attic",say("tea"))',
            None,
            (
                'the robot never went to the attic, where it was to say something with "tea": it '
                "only went to the lobby and the kitchen"
            ),
        ),
        (
            TWICE,
            'tr.AfterFirst(goto("kitchen")).ActAtSome("attic",say("tea"))',
            None,
            (
                "after going to the kitchen at step 4, the robot never went to the attic, where it "
                'was to say something with "tea": it only went to the lobby'
            ),
        ),
        (
            TWICE,
            'tr.AfterFirst(pick("cup")).Count(place("x"),2)',
            None,
            'the robot never picked up "cup"; it never put down "x", but it should have twice',
        ),
        (
            TWICE,
            'tr.AfterLast(pick("mug")).Exists(goto("kitchen|lobby"))',
            0,
            (
                'the robot never went to the kitchen or the lobby after picking up "mug" at step 7: '
                "it did so only at steps 1, 3, 4 and 6, too early"
            ),
        ),
        (
            TWICE,
            ('tr.Exists(place(".*")) or tr.AfterFirst(goto("kitchen")).ActAtFirst("lobby",say("tea"))'),
            4,
            (
                "one of two things had to be so, but the robot never put down anything, and after "
                "going to the kitchen at step 4, the robot went to the lobby at step 6 but did not "
                'say anything with "tea" there: it did so only at step 5, after going to the kitchen '
                "at step 4"
            ),
        ),
        (
            TWICE,
            ('tr.AfterFirst(goto("kitchen")).ActAtFirst("lobby",say("tea")) or tr.Exists(place(".*"))'),
            4,
            (
                "one of two things had to be so, but the robot never put down anything, and after "
                "going to the kitchen at step 4, the robot went to the lobby at step 6 but did not "
                'say anything with "tea" there: it did so only at step 5, after going to the kitchen '
                "at step 4"
            ),
        ),
        (
            TWICE,
            'not tr.AfterFirst(goto("lobby")).AfterFirst(goto("lobby")).Exists(pick("mug"))',
            6,
            (
                'the robot picked up "mug" at step 7, which it must not do after going to the lobby '
                "(step 1) and after going to the lobby (step 3)"
            ),
        ),
        (
            TWICE,
            'not (tr.Exists(say("tea")) and tr.AtLeast(say(".*"),2))',
            4,
            (
                'the robot said "tea" at step 5 and said something 3 times (steps 2, 5 and 8), which '
                "must not both be so"
            ),
        ),
        (
            TWICE,
            'not (tr.Exists(say("tea")) and not tr.AtLeast(say(".*"),5))',
            7,
            (
                'the robot said "tea" at step 5 and said something 3 times (steps 2, 5 and 8), which '
                "must not both be so"
            ),
        ),
        (
            TWICE,
            'not (tr.Exists(say("tea")) and tr.AtLeast(say("x"),0))',
            4,
            ('the robot said "tea" at step 5 and never said anything with "x", which must not both be so'),
        ),
        (
            TWICE,
            'not (tr.Exists(say("tea")) and not tr.Count(pick("x"),1))',
            4,
            'the robot said "tea" at step 5 and never picked up "x", which must not both be so',
        ),
        (
            NOTHING,
            'tr.Exists(ask("x",".*")) or tr.Exists(ask(".*","x"))',
            None,
            'the robot did nothing at all, so it never mentioned "x" in a question or its options',
        ),
        (
            NOTHING,
            'tr.Exists(pick("x")) or tr.Exists(place("x"))',
            None,
            (
                "one of two things had to be so, but the robot did nothing at all, so it never put "
                'down "x", and it did nothing at all, so it never picked up "x"'
            ),
        ),
        (
            NOTHING,
            'tr.AfterFirst(pick("x")).ActAtFirst("lobby",say("x"))',
            None,
            "the robot did nothing at all, so it never went to the lobby",
        ),
    ],
)
def test_sentence(trace: Trace, text: str, event: int | None, sentence: str) -> None:
    why = explain(parse(text, skills=WITH_WAVE), trace)
    assert why is not None
    assert (why.sentence, why.event) == (sentence, event)


@pytest.mark.parametrize(
    ("text", "clause"),
    [
        ('tr.Exists(pick("x")) and tr.Exists(say("x"))', 'tr.Exists(pick("x"))'),
        ('tr.Exists(say("hi")) and tr.Exists(say("x"))', 'tr.Exists(say("x"))'),
        ('not not tr.Exists(say("x"))', 'tr.Exists(say("x"))'),
        ('not (tr.Exists(pick("x")) or tr.Exists(say("hi")))', 'not tr.Exists(say("hi"))'),
        ('not (tr.Exists(say("hi")) and tr.Exists(say("tea")))',) * 2,
        ('tr.Exists(pick("x")) or tr.Exists(place("x"))',) * 2,
        ('tr.Exists(ask("x", ".*")) or tr.Exists(ask(".*", "x"))',) * 2,
        ('tr.Count(say("x"), 1)',) * 2,
        ('tr.Count(say("hi"), 0)',) * 2,
        ('tr.Count(say(".*"), 2)',) * 2,
        ('tr.ActAtFirst("lobby", pick("mug"))',) * 2,
        ('tr.ActAtSome("attic", pick("mug"))',) * 2,
        ('not tr.Count(say("x"), 0)',) * 2,
        ('not tr.AtLeast(say("hi"), 0)',) * 2,
        ('not tr.AtLeast(say("hi"), 1)',) * 2,
        ('not tr.AtLeast(say("hi"), 2)',) * 2,
        ('not tr.Exists(say("hi"))',) * 2,
        ('not tr.ActAtSome("lobby", say("hi"))',) * 2,
    ],
)
def test_clause(text: str, clause: str) -> None:
    why = explain(parse(text), TWICE)
    assert why is not None
    assert str(why.clause) == clause


@pytest.mark.parametrize(
    ("text", "clause"),
    [
        (
            'tr.Exists(pick("z")) or not (tr.Exists(say("z")) or tr.Exists(ask("a", "b")))',
            'tr.Exists(ask("a", "b"))',
        ),
        ('tr.Exists(goto("x")) and not not tr.Exists(ask("a", "b"))', 'tr.Exists(ask("a", "b"))'),
        ('tr.ActAtSome("x", ask("a", "b"))',) * 2,
    ],
)
def test_clause_that_cannot_be_judged(text: str, clause: str) -> None:
    why = explain(parse(text), LONG)
    assert why is not None
    assert str(why.clause) == clause


def test_what_holds_needs_no_explanation() -> None:
    assert explain(parse('tr.Exists(say("hi"))'), TWICE) is None
