"""The arguments that a program's text gives to its skills are found without a run."""

import pytest

from codebotler.checking.source.written_arguments import WrittenArguments, read_arguments
from codebotler.core.skills.paper import SKILLS
from codebotler.core.text.text_template import ANY_TEXT


def read(*lines: str) -> WrittenArguments:
    return read_arguments("def task_program():\n    " + "\n    ".join(lines) + "\n", SKILLS)


def said_texts(*lines: str) -> tuple[set[str], bool]:
    """Return the texts of `say`, and whether there are no others."""
    found = read(*lines).skills["say"]["message"]
    return set(map(str, found)), ANY_TEXT not in found


@pytest.mark.parametrize(
    ("lines", "texts"),
    [
        (["say('a')", "say(message='b')"], {"a", "b"}),
        (["x = 'a'", "x = 'b'", "say(x)"], {"a", "b"}),
        (["say('a' if is_in_room('x') else 'b')"], {"a", "b"}),
        (["say(f'{len([])} mugs')"], {"{} mugs"}),
        (["for n in ('1', '2'):", "    say('room ' + n)"], {"room 1", "room 2"}),
        (["say('There is none in ' + ', '.join([]))"], {"There is none in {}"}),
        (["say('%d of %s' % (1, 'a'))"], {"{} of {}"}),
        (["say('{0:.2f} m of {name}'.format(1.0, name='a'))"], {"{} m of {}"}),
        (["x = 'a'", "x += 'b'", "say(x)"], {"a", "{}b"}),
        (["def f(a, b='z'):", "    say(a + b)", "f('x')"], {"xz"}),
        (["def f():", "    return 'x'", "say(f())"], {"x"}),
        (["a, b = 'x', 'y'", "say(b)"], {"y"}),
        (["say((x := 'a').strip())"], {"a"}),
        (["rooms = ['a', 'b']", "rooms.append('c')", "for room in rooms:", "    say(room)"], {"a", "b", "c"}),
    ],
)
def test_texts_are_known_if_the_program_composes_them(lines: list[str], texts: set[str]) -> None:
    assert said_texts(*lines) == (texts, True)


@pytest.mark.parametrize(
    "lines",
    [
        ["say(get_current_location())"],
        ["for room in get_all_rooms():", "    say(room)"],
        ["with open('x') as f:", "    say(f)"],
        ["say(*['a'])"],
        ["say(**{'message': 'a'})"],
        ["talk = say", "talk('a')"],
        ["list(map(say, ['a']))"],
        ["def f(a):", "    say(a)", "g = f", "g('a')"],
        ["exec('say(1)')", "say('a')"],
        ["say('100%% of %s' % 'a')"],
        ["say('{{}} of {}'.format('a'))"],
        ["rooms = ['a']", "rooms.extend(get_all_rooms())", "for room in rooms:", "    say(room)"],
        ["rooms = []", "rooms.append(get_current_location())", "for room in rooms:", "    say(room)"],
        ["rooms = ['a'] + get_all_rooms()", "for room in rooms:", "    say(room)"],
        ["for letter in 'ab':", "    say(letter)"],
        ["a = 'x'", "f = lambda a: say(a)", "f(get_current_location())"],
        ["a = 'x'", "f = lambda *, a: say(a)", "f(a=get_current_location())"],
        ["x = 'a'", "for _ in range(3):", "    x = x + x", "say(x)"],
    ],
)
def test_texts_that_depend_on_more_than_the_source_are_unbounded(lines: list[str]) -> None:
    assert not said_texts(*lines)[1]


def test_lists_of_options_are_read() -> None:
    found = read("ask('Ann', 'Tea?', ['yes', 'no'])").skills["ask"]["options"]
    assert set(map(str, found)) == {"yes", "no"}


def test_name_that_the_program_binds_is_not_a_skill() -> None:
    assert "say" not in read("def say(x):", "    pass", "say('a')").skills


@pytest.mark.parametrize(
    ("line", "reads"),
    [
        ("time.sleep(3)", False),
        ("say('datetime')", False),
        ("x = time.time()", True),
        ("import datetime; datetime.datetime.now()", True),
        ("from random import choice; choice([1])", True),
        ("from time import sleep; sleep(1)", False),
        ("from time import time; time()", True),
        ("import time as t; t.time()", True),
        ("from calendar import datetime as t; t.datetime.now()", True),
        ("import calendar; calendar.datetime.datetime.now()", True),
        ("t = time; t.time()", True),
        ("import logging; logging.time.time()", True),
        ("import timeit as t; t.default_timer()", True),
        ("import typing; typing.sys.modules.get('ti' + 'me').gmtime()", True),
        ("globals()['ti' + 'me'].time()", True),
        ("(lambda: 0).__globals__['ti' + 'me']", True),
        ("import operator; operator.attrgetter('_sys.modules')(operator)", True),
        ("from operator import attrgetter as get; get('_sys')", True),
        ("from operator import *", True),
        ("import dataclasses; dataclasses.inspect.os.urandom(1)", True),
        ("import collections; collections._sys", True),
        ("say(__name__)", False),
        ("import time; time.sleep(3)", False),
        ("time = 3", False),
        ("rooms = []; rooms.copy(); rooms.index('a')", False),
        ("import math, re; math.sqrt(2)", False),
        ("from collections import Counter; Counter()", False),
    ],
)
def test_reads_clock_if_the_program_may_reach_a_clock_or_random_numbers(line: str, *, reads: bool) -> None:
    assert read(line).reads_clock is reads


def test_unparsable_program_has_unbounded_texts() -> None:
    found = read_arguments("(" * 5_000 + ")" * 5_000, SKILLS)
    assert all(ANY_TEXT in one for texts in found.skills.values() for one in texts.values())
