"""Threads that read Python sources at the same time."""

import ast
import subprocess
import sys
import warnings

import pytest

from codebotler.core.syntaxtree import parse, parse_expression

# Garbage is collected all the time, by Python code: so threads are often interrupted while they make a tree.
THREADS = """
import gc, sys
from concurrent.futures import ThreadPoolExecutor
from codebotler.core.syntaxtree import parse

class Knot:
    def __init__(self):
        self.me = self
    def __del__(self):
        for _ in range(100):
            pass

def read(number):
    Knot()
    return len(parse(SOURCE).body)

SOURCE = "def task_program():\\n" + "".join(f"    say('{n}', [1, (2, {n} + {n} * 3)])\\n" for n in range(300))
sys.setswitchinterval(1e-6)
gc.set_threshold(5)
with ThreadPoolExecutor(4) as threads:
    print(sum(threads.map(read, range(60))))
"""


def test_threads_read_sources_at_the_same_time() -> None:
    ended = subprocess.run(
        [sys.executable, "-c", THREADS], capture_output=True, text=True, check=False, timeout=120
    )
    assert ended.stdout == "60\n", ended.stderr


def test_odd_escapes_are_not_warned_of() -> None:
    with warnings.catch_warnings(action="error"):
        assert isinstance(parse(r"say('\d')").body[0], ast.Expr)
        assert isinstance(parse_expression(r"'\d'"), ast.Constant)


def test_what_is_no_python_is_told() -> None:
    with pytest.raises(SyntaxError):
        parse("def")
    with pytest.raises(SyntaxError):
        parse("return 1", compiled=True)
    parse("return 1")
