"""Random robot programs, written from a grammar whose rules are pieces of Python.

In a rule, a name in capitals stands for what is drawn next: `TEXT`, `NUMBER`, `TRUTH`, `LIST` (of texts),
`DICT` (of numbers by text), `SET` and `DATA` for an expression, `ROOM` and `THING` for a text that often fits
the world, `T`, `N`, `L` and `D` for a variable, `ITEM` for the variable of a comprehension, `BLOCK` for
statements, `JUMP` for what leaves them, `F` for the function or class that a rule defines. The number before a
rule is its weight.

No program is hostile: texts and numbers grow slowly in loops, sets hold only what hashes alike in every
process, and nothing is asked of files, threads or the network.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from hypothesis import strategies as st

DEEPEST_EXPRESSION, DEEPEST_BLOCK, DEEPEST_DEFINITION = 3, 3, 2

Rules = tuple[tuple[int, str], ...]


def rules(text: str) -> Rules:
    """Rules of one line each, with their weights."""
    pairs = (line.split(maxsplit=1) for line in text.strip().splitlines())
    return tuple((int(weight), rule) for weight, rule in pairs)


EXPRESSIONS: dict[str, Rules] = {
    "ROOM": rules(
        """
        6 'kitchen'
        4 "amy's lab"
        3 "the Conference Room"
        2 'start_loc'
        2 get_all_rooms()[NUMBER % 3]
        1 random.choice(get_all_rooms())
        1 TEXT
        """
    ),
    "THING": rules(
        """
        4 'apple'
        3 'red stapler'
        2 'mug'
        1 TEXT
        """
    ),
    "TEXT": rules(
        """
        4 'hello'
        2 'Yes'
        2 'no'
        2 'the Kitchen is nice'
        1 ''
        1 "it's {}\\n \\"quoted\\" "
        1 'ä☃\\U0001f916 \\x07'
        4 get_current_location()
        3 f'{TEXT} and {NUMBER:>3} {TEXT!r:.9}'[:60]
        2 (TEXT + TEXT)[-40:]
        1 ask('somebody', TEXT, ['yes', 'no', TEXT])
        1 ask(TEXT, question=TEXT, options=[TEXT, *LIST])
        2 TEXT.upper()
        1 TEXT.strip().title()
        1 TEXT.replace(TEXT, 'x')[:40]
        1 TEXT[::-1]
        1 TEXT[1:NUMBER]
        1 (TEXT * (NUMBER % 4))[:40]
        2 ', '.join(LIST)[:60]
        2 str(DATA)[:50]
        1 '%s: %d%%' % (TEXT, NUMBER)
        1 '{} {!r:>5}'.format(TEXT, NUMBER)[:60]
        1 '{0[a]:03d} {x.real}'.format(DICT, x=NUMBER)[:60]
        2 TEXT if TRUTH else TEXT
        1 (TEXT or TEXT)
        2 (LIST or ['kitchen'])[0]
        1 LIST[-NUMBER]
        1 max(LIST, key=len, default=TEXT)
        1 next(iter(LIST), TEXT)
        1 random.choice(LIST or ['x'])
        1 (lambda a, *rest, b=NUMBER, **more: (TEXT * (b % 3))[:40])(TEXT, *LIST)
        1 (T := TEXT)
        1 time.strftime('%H:%M:%S')
        1 type(DATA).__name__
        1 chr(97 + NUMBER % 26)
        1 (TEXT.partition(' ')[0] and TEXT)
        1 TEXT.encode().decode('utf-8', 'ignore')
        1 json.dumps([LIST, DICT])[:60]
        1 functools.reduce(lambda a, b: (a + str(b))[-30:], LIST, TEXT)
        """
    ),
    "NUMBER": rules(
        """
        4 0
        3 1
        3 2
        2 3
        1 7
        1 -1
        1 60
        3 len(LIST)
        2 len(TEXT)
        2 (NUMBER + NUMBER)
        1 (NUMBER - NUMBER)
        1 (NUMBER * NUMBER % 101)
        1 NUMBER // NUMBER
        1 NUMBER // (NUMBER or 1)
        1 (NUMBER & 7 | 1 ^ -NUMBER)
        1 int(TRUTH)
        1 sum(len(ITEM) for ITEM in LIST if TRUTH)
        1 TEXT.count('a')
        1 TEXT.find(TEXT)
        1 DICT.get(TEXT, NUMBER)
        1 DICT[TEXT]
        1 max(DICT.values(), default=NUMBER)
        1 random.randint(0, 5)
        1 round(random.random() * 10)
        1 hash(TEXT) % 7
        1 int(time.time()) % 1000
        1 int(str(NUMBER), 16)
        1 int('12')
        1 ord(TEXT[:1] or 'a')
        1 (N := NUMBER)
        1 math.isqrt(abs(NUMBER))
        1 min(NUMBER, NUMBER)
        1 LIST.index(TEXT)
        """
    ),
    "TRUTH": rules(
        """
        3 True
        2 False
        5 is_in_room(THING)
        2 TEXT in LIST
        2 TEXT == TEXT
        1 NUMBER < NUMBER <= NUMBER
        2 not TRUTH
        1 (TRUTH and TRUTH)
        1 (TRUTH or TRUTH)
        1 any(ITEM == TEXT for ITEM in LIST)
        1 all(TRUTH for ITEM in LIST)
        1 TEXT.startswith(TEXT)
        1 isinstance(DATA, (str, list))
        1 TEXT in DICT
        1 'lab' in TEXT
        1 ask('Amy', TEXT, ['Yes', 'No']) == 'yes'
        1 LIST == LIST
        1 DATA is not None
        1 SET <= SET
        1 NUMBER > 2
        1 re.search('a+', TEXT) is None
        """
    ),
    "LIST": rules(
        """
        3 ['yes', 'no']
        1 []
        4 get_all_rooms()
        2 [TEXT, TEXT]
        2 [TEXT, *LIST][:5]
        2 [TEXT for ITEM in LIST if TRUTH][:9]
        1 [ITEM + x for ITEM in LIST for x in TEXT[:3]][:9]
        1 list(map(str.lower, LIST))
        2 sorted(LIST, key=lambda a: (NUMBER, a), reverse=TRUTH)
        1 TEXT.split()
        1 LIST[1:]
        1 LIST[::-2]
        1 LIST[:NUMBER]
        1 (LIST + LIST)[:6]
        1 list(dict.fromkeys(LIST))
        2 list(SET)
        1 sorted(SET)
        1 [str(x) for x in range(NUMBER % 4)]
        1 list(DICT)
        1 random.sample(LIST, len(LIST))
        1 [y + str(x) for x, y in enumerate(LIST)][:6]
        1 list(filter(None, LIST))
        1 list(itertools.islice(itertools.cycle(LIST), 4))
        1 [(y := TEXT), y]
        1 [*{TEXT: NUMBER}, *SET][:6]
        1 list(ITEM for ITEM in LIST)
        """
    ),
    "DICT": rules(
        """
        3 {'a': 1}
        1 {}
        2 {TEXT: NUMBER}
        1 {ITEM: NUMBER for ITEM in LIST if TRUTH}
        1 {**DICT, TEXT: NUMBER}
        1 dict(zip(LIST, range(9)))
        1 dict.fromkeys(LIST, NUMBER)
        1 collections.Counter(LIST)
        1 (DICT | DICT)
        1 dict(a=NUMBER, **DICT)
        """
    ),
    "SET": rules(
        """
        3 {'x', 'y', 'z'}
        2 {TEXT, TEXT}
        2 set(LIST)
        1 {TEXT for ITEM in LIST}
        1 (SET | SET)
        1 (SET - SET)
        1 frozenset(TEXT[:5])
        """
    ),
    "DATA": rules(
        """
        3 None
        3 TEXT
        3 NUMBER
        2 LIST
        2 DICT
        1 SET
        1 TRUTH
        1 (TEXT, NUMBER)
        1 2.5
        1 b'ab\\x00'
        1 range(3)
        1 ...
        1 NUMBER / 3
        """
    ),
}

# A statement that takes one line, or, where a line ends in a backslash and n, several.
STATEMENTS: Rules = rules(
    r"""
    36 say(TEXT)
    32 go_to(ROOM)
    16 T = TEXT
    12 N = NUMBER
    12 L = LIST
    8 D = DICT
    3 T = T2 = TEXT
    3 T, N = TEXT, NUMBER
    3 T, *L = [TEXT, TEXT, *LIST][:6]
    3 T += 'x'
    8 N += NUMBER
    3 N -= 1
    3 N *= 3
    8 L.append(TEXT)
    3 L += [TEXT]
    3 L[1:2] = LIST[:3]
    1 L[NUMBER] = TEXT
    3 L.extend(LIST[:2])
    3 L.sort()
    3 L.insert(0, TEXT)
    1 T = L.pop()
    1 L.remove(TEXT)
    8 D[TEXT] = NUMBER
    3 D.update(DICT)
    3 D.setdefault(TEXT, NUMBER)
    3 D.pop(TEXT, None)
    3 note: str = TEXT\nsay(note)
    12 print(DATA, TEXT, sep='-')
    8 time.sleep(NUMBER % 50)
    3 time.sleep(NUMBER / 2)
    24 if TRUTH:\n    BLOCK
    16 if TRUTH:\n    BLOCK\nelse:\n    BLOCK
    8 if TRUTH:\n    BLOCK\nelif TRUTH:\n    BLOCK\nelse:\n    BLOCK
    12 if is_in_room(THING):\n    pick(THING)
    12 pick('apple')\nBLOCK\nplace('apple')
    12 try:\n    pick(THING)\n    BLOCK\nexcept Exception as e:\n    say(type(e).__name__)
    16 for T in LIST:\n    BLOCK
    12 for T in get_all_rooms():\n    go_to(T)\n    BLOCK
    8 for N in range(NUMBER % 4):\n    BLOCK
    3 for N, T in enumerate(LIST):\n    BLOCK
    3 for T, N in DICT.items():\n    BLOCK
    8 for T in LIST:\n    BLOCK\n    if TRUTH:\n        JUMP\nelse:\n    BLOCK
    8 while N < 3:\n    N += 1\n    BLOCK
    8 while TRUTH:\n    BLOCK\n    JUMP
    8 while True:\n    BLOCK\n    if TRUTH:\n        break\n    BLOCK
    16 while True:\n    BLOCK
    14 while not is_in_room(THING):\n    time.sleep(NUMBER)
    8 time.sleep(NUMBER * 600)
    3 while TRUTH:\n    BLOCK\nelse:\n    BLOCK
    1 for T in iter(get_current_location, ROOM):\n    BLOCK
    16 try:\n    BLOCK\nexcept Exception as e:\n    say(type(e).__name__ + str(e)[:60])
    8 try:\n    BLOCK\nexcept Exception as e:\n    if type(e).__name__ != 'GoToInvalidLocation':\n        raise\n    BLOCK
    3 try:\n    BLOCK\nexcept (TypeError, ValueError, LookupError):\n    BLOCK\nelse:\n    BLOCK\nfinally:\n    BLOCK
    3 try:\n    BLOCK\nfinally:\n    BLOCK
    3 try:\n    BLOCK\nexcept:\n    BLOCK
    1 try:\n    BLOCK\nexcept BaseException as e:\n    say(type(e).__name__)\n    raise RuntimeError(TEXT) from e
    1 try:\n    raise ExceptionGroup(TEXT, [ValueError(TEXT), KeyError(NUMBER)])\nexcept* KeyError as e:\n    say(str(e.exceptions))
    1 assert TRUTH, TEXT
    1 raise ValueError(TEXT)
    1 raise KeyError(DATA) from None
    1 del T
    1 del L[0:1]
    1 del D[TEXT]
    1 sys.exit(NUMBER % 3)
    1 exit()
    1 sys.exit(TEXT)
    1 T = input()
    3 with contextlib.suppress(Exception):\n    BLOCK
    8 match TEXT:\n    case 'kitchen' | 'start_loc':\n        BLOCK\n    case str() as m0 if TRUTH:\n        say(m0)\n    case _:\n        BLOCK
    8 match LIST:\n    case []:\n        BLOCK\n    case [m0]:\n        say(m0)\n    case [m0, *m1]:\n        say(m0 + str(len(m1)))
    3 match DATA:\n    case {'a': m0, **m1}:\n        say(str(m0))\n    case int(m0) | [m0, _]:\n        say(str(m0))\n    case None:\n        BLOCK
    3 import math\nsay(str(math.sqrt(NUMBER % 9)))
    3 from random import choice as one_of\nsay(one_of(['a', 'b', TEXT]))
    3 from collections import defaultdict, deque\nm0 = defaultdict(int)\nm0[TEXT] += 1\nsay(str(m0)[:60])
    1 import datetime\nsay(str(datetime.datetime.now()))
    1 import string, textwrap as tw\nsay(tw.shorten(TEXT, 20) + string.digits)
    3 random.shuffle(L)
    1 random.seed(NUMBER)
    3 speak = say\nspeak(TEXT)
    3 list(map(say, LIST))
    3 say(str(DATA)[:80])
    1 say(undefined_name)
    1 JUMP
    1 say(NUMBER)
    1 go_to()
    1 say(TEXT, TEXT)
    1 say(msg=TEXT)
    1 ask(TEXT, TEXT)
    1 ask('x', TEXT, (TEXT, TEXT))
    3 say(str(ask('x', TEXT, [NUMBER, None, TEXT])))
    1 ask('x', TEXT, LIST)
    1 place(DATA)
    3 try:\n    say(DATA)\nexcept TypeError as e:\n    say(str(e)[:80])
    3 global g0\ng0 = TEXT
    1 say(str(eval('n0 + 1')))
    1 pass
    """
)


@dataclass(frozen=True)
class Definition:
    """A function or class, and the rules that use it once it is there.

    Args:
        text: its source; in it, parameters `a`, `b` and `c` hold a text, a number and a list.
        uses: further rules by the capitals that they are for.
    """

    text: str
    uses: dict[str, tuple[str, ...]]


DEFINITIONS = (
    Definition("def F():\n    BLOCK", {"STATEMENT": ("F()",)}),
    Definition(
        "def F(a, b=2):\n    BLOCK\n    return TEXT",
        {"TEXT": ("F(TEXT)", "F(TEXT, NUMBER)", "F(b=NUMBER, a=TEXT)"), "STATEMENT": ("F(TEXT)", "F(DATA)")},
    ),
    Definition(
        "def F(a, /, b=1, *, c=None):\n    c = c or LIST\n    BLOCK\n    return c",
        {"LIST": ("F(TEXT)", "F(TEXT, c=LIST)"), "STATEMENT": ("F(TEXT, c=LIST)", "F(a=TEXT)")},
    ),
    Definition(
        "def F(*args, **kwargs):\n    BLOCK\n    return [str(x)[:9] for x in (*args, *kwargs.items())][:6]",
        {"LIST": ("F(*LIST)", "F(TEXT, b=NUMBER)", "F(*LIST, **DICT)")},
    ),
    Definition(
        "def F(a):\n    for x in LIST:\n        BLOCK\n        yield x\n    yield from LIST\n    return a",
        {"LIST": ("list(F(TEXT))[:9]",), "STATEMENT": ("for T in F(TEXT):\n    BLOCK", "T, *L = F(TEXT)")},
    ),
    Definition(
        "def F(a, b=3):\n    if b <= 0:\n        return a\n    BLOCK\n    return F(TEXT, b - 1)",
        {"TEXT": ("F(TEXT, NUMBER % 6)",), "STATEMENT": ("F(TEXT)",)},
    ),
    Definition(
        "def F(b=0):\n    global deepest\n    deepest = b\n    F(b + 1)",
        {"STATEMENT": ("try:\n    F()\nexcept RecursionError as e:\n    say(str(deepest) + str(e))",)},
    ),
    Definition(
        "def F(a):\n    total = NUMBER\n    def inner(b=1):\n        nonlocal total\n        total += b\n        BLOCK\n"
        "        return total\n    return inner",
        {"NUMBER": ("F(TEXT)(NUMBER)", "F(TEXT)()"), "STATEMENT": ("m2 = F(TEXT)\nm2()\nsay(str(m2()))",)},
    ),
    Definition(
        "def F(function):\n    @functools.wraps(function)\n    def wrapper(*args, **kwargs):\n        BLOCK\n"
        "        return function(*args, **kwargs)\n    return wrapper",
        {"STATEMENT": ("@F\ndef decorated(a=TEXT):\n    say(a)\ndecorated()\nsay(decorated.__name__)", "F(say)(TEXT)")},
    ),
    Definition("F = lambda a='x', b=1: TEXT", {"TEXT": ("F()", "F(TEXT, NUMBER)", "F(b=NUMBER)")}),
    Definition(
        "class F:\n    count = 0\n    def __init__(self, a):\n        self.a = a\n        F.count += 1\n        BLOCK\n"
        "    @property\n    def name(self):\n        BLOCK\n        return self.a\n    @name.setter\n"
        "    def name(self, a):\n        self.a = a\n    @staticmethod\n    def twice(b):\n        return b + b\n"
        "    @classmethod\n    def made(cls, a):\n        return cls(a)\n    def __str__(self):\n        return f'<{self.a}>'\n"
        "    def __eq__(self, other):\n        return TRUTH\n    __hash__ = None\n",
        {
            "TEXT": ("F(TEXT).name", "str(F(TEXT))", "F.made(TEXT).a"),
            "NUMBER": ("F.count", "F.twice(NUMBER)", "F(TEXT).count"),
            "TRUTH": ("F(TEXT) == TEXT",),
            "STATEMENT": ("m3 = F(TEXT)\nm3.name = TEXT\nsay(m3.name)", "F(TEXT).missing", "say(F(TEXT))"),
        },
    ),
    Definition(
        "class F:\n    def __enter__(self):\n        BLOCK\n        return TEXT\n    def __exit__(self, kind, error, _):\n"
        "        say(str(kind and kind.__name__))\n        return TRUTH\n",
        {"STATEMENT": ("with F() as T:\n    BLOCK", "with F(), F() as T:\n    BLOCK")},
    ),
    Definition(
        "@contextlib.contextmanager\ndef F(a):\n    try:\n        yield a\n    finally:\n        BLOCK",
        {"STATEMENT": ("with F(TEXT) as T:\n    BLOCK",)},
    ),
    Definition(
        "class F(Exception):\n    def __str__(self):\n        return 'own ' + TEXT",
        {"STATEMENT": ("raise F(TEXT)", "try:\n    BLOCK\n    raise F(TEXT)\nexcept F as e:\n    say(str(e))")},
    ),
    Definition(
        "@dataclasses.dataclass(order=True)\nclass F:\n    a: str\n    b: int = 1\n"
        "    c: list = dataclasses.field(default_factory=list)",
        {"TEXT": ("repr(F(TEXT, NUMBER).b)", "max(F(TEXT), F(TEXT, NUMBER)).a", "str(F(TEXT, 2))[:40]")},
    ),
    Definition(
        "class F(list):\n    def __getitem__(self, at):\n        BLOCK\n        return super().__getitem__(at)\n"
        "    def __len__(self):\n        return NUMBER\n    def __iter__(self):\n        yield from LIST\n",
        {"LIST": ("list(F(LIST))[:9]", "F(LIST)[:2]"), "NUMBER": ("len(F(LIST))",), "STATEMENT": ("ask('x', TEXT, F(LIST))",)},
    ),
    Definition(
        "class F(str):\n    def __str__(self):\n        say('str')\n        return TEXT\n",
        {"STATEMENT": ("say(F(TEXT))", "say(str(ask('x', TEXT, [F(TEXT), 'no'])))")},
    ),
    Definition(
        "class F(enum.Enum):\n    ONE = TEXT\n    TWO = NUMBER\n",
        {"TEXT": ("F.ONE.name", "str(F.TWO)", "repr(list(F))[:40]"), "STATEMENT": ("say(F(TEXT).name)",)},
    ),
)  # fmt: skip

MODULES = "collections contextlib dataclasses enum functools itertools json math random re"
VARIABLES = {"T": "TEXT", "N": "NUMBER", "L": "LIST", "D": "DICT"}
PARAMETERS = {"a": "TEXT", "b": "NUMBER", "c": "LIST"}
COUNT = 3  # variables of each kind at module level; functions write only the first
START = {"T": "'kitchen'", "N": "2", "L": "['yes', 'no']", "D": "{'a': 1}"}


@dataclass
class Scope:
    """What a function, a class or the module knows while its text is written.

    Args:
        kind: `module`, `global`, `local` or `nonlocal`: what the variables that it assigns are.
        readable: names that hold a text and so on.
        uses: rules for what was defined.
        loops: how many loops its statement stands in.
    """

    kind: str
    readable: dict[str, list[str]]
    uses: dict[str, list[str]]
    loops: int = 0


@dataclass
class Writer(ast.NodeTransformer):
    """Writes one program: replaces the capitals in rules by what is drawn.

    Args:
        draw: draws from a strategy.
    """

    draw: Any
    scopes: list[Scope] = field(default_factory=list)
    expressions: int = 0
    blocks: int = 0
    items: int = 0
    defined: int = 0
    plain: bool = False
    walrus: bool = True
    chosen: dict[str, str] = field(default_factory=dict)

    def program(self) -> str:
        """The text of a program."""
        names = {kind: [f"{name.lower()}{i}" for i in range(COUNT)] for name, kind in VARIABLES.items()}
        self.scopes = [Scope("module", names, {})]
        tree = ast.parse(f"import {', '.join(MODULES.split())}")
        forgotten = self.number(80)
        starts = [f"{name.lower()}{i} = {START[name]}" for name in VARIABLES for i in range(COUNT)]
        tree.body += ast.parse("\n".join(s for i, s in enumerate(starts) if i != forgotten - 1)).body
        tree.body += self.definitions()
        tree.body += self.statements(self.number(2))
        tree.body += ast.parse("def task_program(): pass").body
        tree.body[-1].body = self.function_body(lambda: self.statements(2 + self.number(6)))  # type: ignore[attr-defined]
        end = self.number(12)
        if end == 1:
            tree.body += ast.parse("if __name__ == '__main__':\n    task_program()").body
        elif end == 2:  # noqa: PLR2004 - another case
            tree.body += [*ast.parse("task_program()").body, *self.statements(1)]
        return ast.unparse(ast.fix_missing_locations(tree))

    # --- drawing

    def number(self, below: int) -> int:
        """A number from 0 and below another; 0 is the simplest."""
        return int(self.draw(numbers(below)))

    def pick(self, choices: Sequence[tuple[int, str]]) -> str:
        """One of the choices, by weight."""
        at = self.number(sum(weight for weight, _ in choices))
        for weight, rule in choices:
            at -= weight
            if at < 0:
                return rule
        raise AssertionError

    @property
    def here(self) -> Scope:
        """The scope that is being written."""
        return self.scopes[-1]

    def used(self, kind: str) -> list[tuple[int, str]]:
        """The rules for what was defined."""
        return [(8, use) for scope in self.scopes for use in scope.uses.get(kind, ())]

    def expression(self, kind: str) -> ast.expr:
        """A random expression."""
        names = [(3, name) for name in self.here.readable.get(kind, ())]
        given = EXPRESSIONS[kind]
        if self.plain and names:
            return ast.Name(self.pick(names), ast.Load())
        if self.plain or self.expressions >= DEEPEST_EXPRESSION:
            choices = [*(r for r in given if is_leaf(r[1])), *names]
        else:
            choices = [*given, *names, *self.used(kind)]
        if not self.walrus:
            choices = [r for r in choices if ":=" not in r[1]]
        self.expressions += 1
        node = self.filled(ast.parse(self.pick(choices), mode="eval").body)
        self.expressions -= 1
        return node  # type: ignore[no-any-return]

    def statements(self, count: int) -> list[ast.stmt]:
        """Random statements."""
        return [node for _ in range(count) for node in self.statement()]

    def statement(self) -> list[ast.stmt]:
        given = STATEMENTS_WITHOUT_BLOCKS if self.blocks >= DEEPEST_BLOCK else STATEMENTS
        uses = self.used("STATEMENT")
        if self.blocks >= DEEPEST_BLOCK:
            uses = [use for use in uses if "BLOCK" not in use[1]]
        rule = self.pick([*given, *uses]).replace("\\n", "\n")
        if rule == "JUMP":
            return [self.jump()]
        self.blocks += 1
        nodes = self.filled_statements(rule)
        self.blocks -= 1
        return nodes

    def jump(self) -> ast.stmt:
        """What leaves a block, as far as it may stand here."""
        choices = [(2, "pass")]
        if self.here.loops:
            choices += [(6, "break"), (3, "continue")]
        if self.here.kind != "module":
            choices += [(1, "return"), (1, "return TEXT")]
        return self.filled_statements(self.pick(choices))[0]

    def definitions(self) -> list[ast.stmt]:
        """Functions and classes for the head of a scope."""
        return [node for _ in range(self.number(4 - len(self.scopes))) for node in self.definition()]

    def definition(self) -> list[ast.stmt]:
        definition = DEFINITIONS[self.number(len(DEFINITIONS))]
        self.defined += 1
        name = f"f{self.defined}"
        blocks, self.blocks = self.blocks, max(self.blocks, 1)
        nodes = self.filled_statements(re.sub(r"\bF\b", name, definition.text))
        self.blocks = blocks
        for kind, uses in definition.uses.items():
            named = [re.sub(r"\bF\b", name, use) for use in uses]
            self.here.uses.setdefault(kind, []).extend(named)
        return nodes

    # --- filling rules

    def filled(self, node: ast.AST) -> Any:  # noqa: ANN401 - a node of the same kind
        """A rule with its capitals replaced; each use of `T` in it is the same variable."""
        chosen, self.chosen = self.chosen, {}
        node = self.visit(node)
        self.chosen = chosen
        return node

    def filled_statements(self, rule: str) -> list[ast.stmt]:
        module: ast.Module = self.filled(ast.parse(rule))
        return module.body

    def visit_Name(self, node: ast.Name) -> ast.expr:  # noqa: N802 - a visitor's
        if node.id in EXPRESSIONS:
            return self.expression(node.id)
        kind = node.id[0]
        if node.id in VARIABLES or node.id == "T2":
            if node.id not in self.chosen:
                count = COUNT if self.here.kind == "module" else 1
                self.chosen[node.id] = f"{kind.lower()}{self.number(count)}"
            return ast.Name(self.chosen[node.id], node.ctx)
        return ast.Name(f"i{self.items}", node.ctx) if node.id == "ITEM" else node

    def visit_Expr(self, node: ast.Expr) -> ast.AST | list[ast.stmt]:  # noqa: N802
        match node.value:
            case ast.Name("BLOCK"):
                return self.statements(1 + self.number(2))
            case ast.Name("JUMP"):
                return [self.jump()]
        return self.generic_visit(node)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.AST:  # noqa: N802
        """Only names in f-strings: before Python 3.12, they may not hold quotes of their own."""
        plain, self.plain = self.plain, True
        self.generic_visit(node)
        self.plain = plain
        return node

    def comprehended(self, node: Any) -> ast.AST:  # noqa: ANN401 - one of four kinds
        """A comprehension, whose first iterable knows nothing of its variables."""
        walrus = self.walrus
        self.walrus = False
        first = node.generators[0]
        first.iter = self.visit(first.iter)
        self.walrus = False
        self.items += 1
        with self.known({"TEXT": [f"i{self.items}"]}):
            for generator in node.generators:
                generator.target = self.visit(generator.target)
                if generator is not first:
                    generator.iter = self.visit(generator.iter)
                generator.ifs = [self.visit(test) for test in generator.ifs]
            for name in ("elt", "key", "value"):
                if hasattr(node, name):
                    setattr(node, name, self.visit(getattr(node, name)))
        self.items -= 1
        self.walrus = walrus
        return node  # type: ignore[no-any-return]

    visit_ListComp = visit_SetComp = visit_DictComp = visit_GeneratorExp = comprehended  # noqa: N815

    @contextmanager
    def known(self, names: dict[str, list[str]]) -> Iterator[None]:
        """Let some more names be read for a while."""
        before = self.here.readable
        self.here.readable = {kind: before.get(kind, []) + names.get(kind, []) for kind in before}
        yield
        self.here.readable = before

    def looped(self, node: Any) -> ast.AST:  # noqa: ANN401 - one of two kinds
        """A loop; its `else` is no part of it."""
        for name in ("target", "iter", "test"):
            if hasattr(node, name):
                setattr(node, name, self.visit(getattr(node, name)))
        self.here.loops += 1
        node.body = self.visited(node.body)
        self.here.loops -= 1
        node.orelse = self.visited(node.orelse)
        return node  # type: ignore[no-any-return]

    visit_For = visit_While = looped  # noqa: N815

    def visited(self, body: list[ast.stmt]) -> list[ast.stmt]:
        nodes: list[ast.stmt] = []
        for node in body:
            seen = self.visit(node)
            nodes += seen if isinstance(seen, list) else [seen]
        return nodes

    def visit_Lambda(self, node: ast.Lambda) -> ast.Lambda:  # noqa: N802
        node.args = self.visit(node.args)
        walrus, self.walrus = self.walrus, False
        with self.known(parameters(node.args)):
            node.body = self.visit(node.body)
        self.walrus = walrus
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:  # noqa: N802
        node.decorator_list = [self.visit(one) for one in node.decorator_list]
        node.args = self.visit(node.args)
        given = node.body
        more = parameters(node.args)
        node.body = self.function_body(lambda: self.visited(given), more)
        return node

    def function_body(
        self, write: Callable[[], list[ast.stmt]], more: dict[str, list[str]] | None = None
    ) -> list[ast.stmt]:
        """The body of a function: what its variables are, perhaps functions of its own, then the rest."""
        outer = self.here.kind
        kinds = ["local", "global", *(["nonlocal"] if outer in ("local", "nonlocal") else [])]
        kind = kinds[self.number(len(kinds))]
        first = [name.lower() + "0" for name in VARIABLES]
        if kind == "local":
            head = "; ".join(f"{name.lower()}0 = {START[name]}" for name in VARIABLES)
        else:
            head = f"{kind} {', '.join(first)}"
        readable = {k: v + (more or {}).get(k, []) for k, v in self.here.readable.items()}
        self.scopes.append(Scope(kind, readable, {}))
        before = self.walrus, self.chosen
        self.walrus, self.chosen = True, {}
        body = ast.parse(head).body
        if len(self.scopes) <= DEEPEST_DEFINITION:
            body += self.definitions()
        body += write()
        self.walrus, self.chosen = before
        self.scopes.pop()
        return body


@lru_cache
def numbers(below: int) -> st.SearchStrategy[int]:
    """Numbers from 0."""
    return st.integers(0, max(0, below - 1))


@lru_cache(maxsize=None)
def is_leaf(rule: str) -> bool:
    """Whether nothing is left to draw in a rule."""
    return not re.search(r"\b(?:[A-Z]{3,}|[TNLD])\b", rule)


STATEMENTS_WITHOUT_BLOCKS = tuple(rule for rule in STATEMENTS if "BLOCK" not in rule[1])


def parameters(given: ast.arguments) -> dict[str, list[str]]:
    """The names of parameters, by what they hold."""
    found: dict[str, list[str]] = {}
    for one in (*given.posonlyargs, *given.args, *given.kwonlyargs):
        if one.arg in PARAMETERS:
            found.setdefault(PARAMETERS[one.arg], []).append(one.arg)
    return found


@st.composite
def programs(draw: st.DrawFn) -> str:
    """Programs that parse, mostly do something and often finish."""
    return Writer(draw).program()


TOKENS = re.compile(r"\w+|\s+|[^\w\s]")
FOREIGN = ("\t", "\f", "\r", "\n", "\\", "'", '"""', "(", "]", "{", ":", "=", "*", "#", "@", "lambda", "async ", "0x", "1_", "$",
           "\ufeff", "\u2028", "\xa0", "ﬁ", "²", "\x00", "\ud800", "\U000e0100", "f'{", "# -*- coding: utf-7 -*-")  # fmt: skip


@st.composite
def broken_programs(draw: st.DrawFn) -> str:
    """Texts of programs with lines and tokens gone, twice there or swapped, and foreign characters among them."""
    text = draw(programs())
    for _ in range(draw(st.integers(1, 4))):
        pieces = text.splitlines(keepends=True) if draw(st.booleans()) else TOKENS.findall(text)
        at = draw(st.integers(0, max(0, len(pieces) - 2)))
        match draw(st.sampled_from(("delete", "double", "swap", "foreign", "any", "cut"))):
            case "delete":
                del pieces[at : at + 1]
            case "double":
                pieces[at:at] = pieces[at : at + 1]
            case "swap":
                pieces[at : at + 2] = pieces[at : at + 2][::-1]
            case "foreign":
                pieces.insert(at, draw(st.sampled_from(FOREIGN)))
            case "any":
                pieces.insert(at, draw(st.text(max_size=5)))
            case _:
                del pieces[at:]
        text = "".join(pieces)
    return text
