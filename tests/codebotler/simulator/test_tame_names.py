"""The verifier of tame programs and CPython's compiler agree on which names are local."""

import ast
import dis
import os
from collections.abc import Iterator
from random import Random
from types import CodeType
from typing import Any

import pytest

from codebotler.core.skills.paper import SKILLS
from codebotler.simulator.sandbox import tame
from codebotler.simulator.sandbox.fuel import nodes_of
from codebotler.simulator.sandbox.tame import ProgramVerifier

NAMES = frozenset(SKILLS)
SPECIAL = ("len", "type", "list", "go_to", "time", "open", "ValueError")
PLAIN = ("x", "y")
Position = tuple[int, int]

# In each statement, N is a name, S a special one, V a value, and BLOCK more statements.
STATEMENTS = """
N = V
N += V
N: int = V
N: int
(N): int = V
(N): int
N[0]: int
N[0]: int = V
(N, y) = (V, V)
[N, *y] = [V]
V
del N
say(f"{V}")
say(S.upper())
assert V, V
if V: BLOCK
while V: BLOCK
for N in V: BLOCK
for N in S(V): BLOCK
try: BLOCK
except ValueError as N: BLOCK
try: BLOCK
finally: BLOCK
with V as N: BLOCK
def f(): BLOCK
def f(N): BLOCK
def f(N, *, y=V): BLOCK
def f(*N, **y): BLOCK
async def f(N): BLOCK
class A: BLOCK
class N: BLOCK
global N
nonlocal N
import time
import time as N
from time import time as N
return V
raise V
match V:
    case N: BLOCK
match V:
    case {"a": N, **y}: BLOCK
pass
break
continue
yield V
""".strip()
VALUES = (
    "1", "'a'", "N", "S", "S(V)", "N(V)", "[V for N in V]", "[S for y in V]", "{V: V for N in V}",
    "sum(V for N in V)", "(N := V)", "[(N := V) for y in V]", "list(map(lambda N: V, V))", "max(V, key=S)",
    "sorted(V, key=lambda y: S(y))", "V if V else V", "V.count(V)", "time.time()", "isinstance(V, S)",
)  # fmt: skip


def split_statements() -> list[str]:
    """Split the statements above, some of which have several lines."""
    found: list[str] = []
    for line in STATEMENTS.splitlines():
        if line.startswith((" ", "except", "finally")):
            found[-1] += "\n" + line
        else:
            found.append(line)
    return found


class Writer:
    """Write random programs that bind special names in every way that Python has."""

    def __init__(self, random: Random) -> None:
        self.random = random
        self.statements = split_statements()

    def program(self) -> str:
        """Return a program whose function binds and reads special names."""
        return f"def task_program({self.random.choice(['', *SPECIAL])}):\n{self.block(1)}\n"

    def block(self, depth: int) -> str:
        """Return some indented statements."""
        lines = "\n".join(self.statement(depth) for _ in range(self.random.randint(1, 3)))
        return "\n".join("    " + line for line in lines.splitlines())

    def statement(self, depth: int) -> str:
        """Return a statement; deep ones hold no others."""
        chosen = self.random.choice(self.statements)
        while "BLOCK" in chosen and depth > 2:
            chosen = self.random.choice(self.statements)
        text = ""
        for line in chosen.splitlines():
            indent = line[: len(line) - len(line.lstrip())]
            head, block, _ = line.partition("BLOCK")
            text += self.fill(head) + "\n"
            if block:
                text += "".join(f"{indent}{each}\n" for each in self.block(depth + 1).splitlines())
        return text.removesuffix("\n")

    def fill(self, text: str, depth: int = 0) -> str:
        """Replace the marks of a string by names and values."""
        filled = ""
        for at, letter in enumerate(text):
            is_mark = not (text[at - 1 : at].isalnum() or text[at + 1 : at + 2].isalnum())
            if letter == "V" and is_mark:
                filled += self.fill(self.random.choice(VALUES if depth < 2 else VALUES[:4]), depth + 1)
            elif letter in "NS" and is_mark:
                filled += self.random.choice((*SPECIAL, *PLAIN) if letter == "N" else SPECIAL)
            else:
                filled += letter
        return filled


def judge_names(source: str, monkeypatch: pytest.MonkeyPatch) -> tuple[set[Position], set[Position]] | None:
    """Return where the verifier takes special names for data and where for functions; None if wild."""
    data: set[Position] = set()
    called: set[Position] = set()
    name, call = ProgramVerifier.ALLOWED[ast.Name], ProgramVerifier.ALLOWED[ast.Call]

    def watch_name(verifier: ProgramVerifier, node: Any) -> None:  # noqa: ANN401 - the signature of the verifier
        name(verifier, node)
        if isinstance(node.ctx, ast.Load) and node.id in verifier.special:
            data.add((node.lineno, node.col_offset))

    def watch_call(verifier: ProgramVerifier, node: Any) -> None:  # noqa: ANN401 - the signature of the verifier
        call(verifier, node)
        if isinstance(node.func, ast.Name) and node.func.id in verifier.special:
            at = node.func.lineno, node.func.col_offset
            (data if verifier.is_data(node.func.id) else called).add(at)

    tree = ast.parse(source)
    with monkeypatch.context() as patch:
        patch.setitem(ProgramVerifier.ALLOWED, ast.Name, watch_name)
        patch.setitem(ProgramVerifier.ALLOWED, ast.Call, watch_call)
        return (data, called) if tame.is_tame(tree, nodes_of(tree), NAMES) else None


def find_loads(code: CodeType) -> Iterator[tuple[bool, Position]]:
    """Yield each load of a name: whether the name is global, and the position."""
    for one in dis.get_instructions(code):
        if one.opname.startswith("LOAD_") and one.positions is not None and one.positions.lineno is not None:
            is_global = one.opname in {"LOAD_GLOBAL", "LOAD_NAME"}
            if is_global or one.opname.startswith(("LOAD_FAST", "LOAD_DEREF", "LOAD_CLASSDEREF")):
                yield is_global, (one.positions.lineno, one.positions.col_offset or 0)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from find_loads(constant)


def has_contradiction(source: str, monkeypatch: pytest.MonkeyPatch) -> bool | None:
    """Return whether verifier and compiler disagree; None if the program is wild or invalid."""
    try:
        code = compile(source, "<program>", "exec")
    except SyntaxError:
        return None
    found = judge_names(source, monkeypatch)
    if found is None:
        return None
    data, called = found
    return any(at in (data if is_global else called) for is_global, at in find_loads(code))


def count_tame(programs: int, seed: int, monkeypatch: pytest.MonkeyPatch) -> int:
    """Count the tame ones of some random programs; fail if verifier and compiler disagree on one."""
    writer, tame_ones = Writer(Random(seed)), 0
    for _ in range(programs):
        source = writer.program()
        disagree = has_contradiction(source, monkeypatch)
        assert not disagree, source
        tame_ones += disagree is False
    return tame_ones


@pytest.mark.filterwarnings("ignore::SyntaxWarning")
def test_names_that_the_verifier_takes_for_data_are_local(monkeypatch: pytest.MonkeyPatch) -> None:
    assert count_tame(250, 0, monkeypatch) > 10


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::SyntaxWarning")
def test_names_that_the_verifier_takes_for_data_are_local_in_many_programs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert count_tame(10_000, int(os.environ.get("FUZZ_SEED", "1")), monkeypatch) > 500


@pytest.mark.parametrize("name", ["type", "go_to", "time"])
def test_annotation_in_parentheses_does_not_bind_a_name(name: str) -> None:
    wild, plain = (
        ast.parse(f"def task_program():\n    {target}: int\n    say(f'{{{name}}}')\n")
        for target in (f"({name})", name)
    )
    assert not tame.is_tame(wild, nodes_of(wild), NAMES)
    assert tame.is_tame(plain, nodes_of(plain), NAMES)
