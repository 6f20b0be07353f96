"""Writes random robot programs by the rules of grammar.txt, and texts that are damaged programs."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from codebotler.core.cachedproperty import cached_property
from codebotler.core.skills.paper import SKILLS
from codebotler.simulator.sandbox.fuel import nodes_of
from codebotler.simulator.sandbox.tame import is_tame

DEEPEST_EXPRESSION, DEEPEST_BLOCK, DEEPEST_DEFINITION = 3, 3, 2

Rules = tuple[tuple[int, str], ...]


@dataclass
class Rule:
    """A rule of the grammar.

    Args:
        weight: how often it is chosen, relative to the other rules of its kind.
        text: its Python text.
        uses: for a definition, the kinds and texts of further rules that use it.
    """

    weight: int
    text: str
    uses: list[tuple[str, str]] = field(default_factory=list)


def read_grammar(text: str) -> dict[str, list[Rule]]:
    """Parse a grammar, and return its rules by kind."""
    grammar: dict[str, list[Rule]] = {}
    rules: list[Rule] = []
    for line in text.splitlines():
        if line.startswith("== "):
            rules = grammar[line[3:]] = []
        elif found := re.fullmatch(r" *(\d+) \| (.*)", line):
            rules.append(Rule(int(found[1]), found[2]))
        elif found := re.fullmatch(r" *> (\w+) (.*)", line):
            rules[-1].uses.append((found[1], found[2]))
        elif (found := re.fullmatch(r" *\| ?(.*)", line)) and rules[-1].uses:
            kind, use = rules[-1].uses[-1]
            rules[-1].uses[-1] = (kind, f"{use}\n{found[1]}")
        elif found:
            rules[-1].text += "\n" + found[1]
    return grammar


@dataclass
class Grammar:
    """The rules from which programs are generated.

    Args:
        weighed: the rules for expressions, by kind.
        statements: the rules for statements.
        definitions: the rules for functions and classes, all equally likely.
        strange: rules for statements of which a program may contain at most one.
    """

    weighed: dict[str, Rules]
    statements: Rules
    definitions: list[Rule]
    strange: Rules = ()

    @cached_property
    def without_blocks(self) -> Rules:
        """Return the rules for statements that contain no other statements."""
        return tuple(rule for rule in self.statements if "BLOCK" not in rule[1])

    @classmethod
    def of(cls, rules: dict[str, list[Rule]], definitions: list[Rule], strange: Rules = ()) -> Grammar:
        """Create a grammar from rules."""
        weighed = {
            kind: tuple((rule.weight, rule.text) for rule in of_kind) for kind, of_kind in rules.items()
        }
        return cls(weighed, weighed.pop("STATEMENT"), definitions, strange)


def is_tame_rule(text: str) -> bool:
    """Return whether a rule yields tame code if all its parts are tame. Sets are never tame."""
    if re.search(r"\bSET\b", text):
        return False
    tree = ast.parse(text)
    return is_tame(tree, nodes_of(tree), frozenset(SKILLS))


def tame_grammar(
    rules: dict[str, list[Rule]], definitions: list[Rule], further: dict[str, list[Rule]]
) -> Grammar:
    """Return a grammar of the tame rules and further ones, with the other statements as strange ones."""
    tame = {
        kind: [rule for rule in (*of_kind, *further.get(kind, ())) if is_tame_rule(rule.text)]
        for kind, of_kind in rules.items()
        if kind != "SET"
    }
    kept = []
    for rule in (*definitions, *further["DEFINITION"]):
        uses = [(kind, use) for kind, use in rule.uses if is_tame_rule(f"{rule.text}\n{use}")]
        if uses and is_tame_rule(rule.text):
            kept.append(Rule(rule.weight, rule.text, uses))
    wild = [rule for rule in rules["STATEMENT"] if not is_tame_rule(rule.text)]
    return Grammar.of(tame, kept, tuple((rule.weight, rule.text) for rule in wild))


GRAMMAR = read_grammar(Path(__file__).with_name("grammar.txt").read_text(encoding="utf-8"))
FURTHER = {kind.removeprefix("TAME "): GRAMMAR.pop(kind) for kind in [*GRAMMAR] if kind.startswith("TAME ")}
DEFINITIONS = GRAMMAR.pop("DEFINITION")
DEEP_DEFINITIONS = GRAMMAR.pop("DEEP DEFINITION")
USUAL = Grammar.of(GRAMMAR, DEFINITIONS)
DEEP = Grammar.of(GRAMMAR, DEFINITIONS + DEEP_DEFINITIONS)
TAME = tame_grammar(GRAMMAR, DEFINITIONS, FURTHER)

MODULES = "collections contextlib copy dataclasses enum functools itertools json math random re"
VARIABLES = {"T": "TEXT", "N": "NUMBER", "L": "LIST", "D": "DICT"}
PARAMETERS = {"a": "TEXT", "b": "NUMBER", "c": "LIST"}
COUNT = 3  # number of variables of each kind in a module, of which functions assign only the first
START = {"T": "'kitchen'", "N": "2", "L": "['yes', 'no']", "D": "{'a': 1}"}
UNUSUAL_ENDS = (
    "del task_program",
    "task_program = None",
    "task_program = lambda: say('hello')",
    "task_program = say",
    "async def task_program():\n    say('never')",
    "def task_program():\n    yield say('never')",
    "def task_program(a):\n    say(a)",
)


@dataclass
class Scope:
    """The names that are known in a function, a class or the module while it is written.

    Args:
        kind: the kind of the variables that it assigns: `module`, `global`, `local` or `nonlocal`.
        readable: the names that can be read, by the kind of their value.
        uses: rules that use what was defined, by kind.
        loops: the number of loops around the current statement.
    """

    kind: str
    readable: dict[str, list[str]]
    uses: dict[str, list[str]]
    loops: int = 0


@dataclass
class Writer(ast.NodeTransformer):
    """Writes one program by replacing the names in capitals in rules with random code.

    Args:
        draw: the function of Hypothesis that draws from a strategy.
        grammar: the rules.
        modules: the modules that programs import first.
    """

    draw: Any
    grammar: Grammar = field(default_factory=lambda: DEEP)
    modules: str = MODULES
    scopes: list[Scope] = field(default_factory=list)
    expressions: int = 0
    blocks: int = 0
    items: int = 0
    defined: int = 0
    plain: bool = False
    walrus: bool = True
    chosen: dict[str, str] = field(default_factory=dict)
    may_be_strange: bool = False

    def program(self) -> str:
        """Return the text of a random program."""
        names = {kind: [f"{name.lower()}{i}" for i in range(COUNT)] for name, kind in VARIABLES.items()}
        self.scopes = [Scope("module", names, {})]
        tree = ast.parse(f"import {', '.join(self.modules.split())}")
        self.may_be_strange = bool(self.grammar.strange) and self.number(4) == 3  # noqa: PLR2004 - one in four
        forgotten = self.number(80)
        starts = [f"{name.lower()}{i} = {START[name]}" for name in VARIABLES for i in range(COUNT)]
        tree.body += ast.parse("\n".join(s for i, s in enumerate(starts) if i != forgotten - 1)).body
        tree.body += self.definitions()
        tree.body += self.statements(self.number(2))
        tree.body += ast.parse("def task_program(): pass").body
        tree.body[-1].body = self.function_body(lambda: self.statements(2 + self.number(6)))  # type: ignore[attr-defined]  # it ends in a function
        match self.number(12):
            case 1:
                tree.body += ast.parse("if __name__ == '__main__':\n    task_program()").body
            case 2:
                tree.body += [*ast.parse("task_program()").body, *self.statements(1)]
            case 3 if self.number(3) == 0:
                tree.body += ast.parse(UNUSUAL_ENDS[self.number(len(UNUSUAL_ENDS))]).body
        return ast.unparse(ast.fix_missing_locations(tree))

    # --- drawing

    def number(self, below: int) -> int:
        """Return a random number from 0 to less than `below`, where 0 gives the simplest program."""
        return int(self.draw(numbers(below)))

    def pick(self, choices: Sequence[tuple[int, str]]) -> str:
        """Return one of the choices at random, by weight."""
        at = self.number(sum(weight for weight, _ in choices))
        for weight, rule in choices:
            at -= weight
            if at < 0:
                return rule
        raise AssertionError

    @property
    def here(self) -> Scope:
        """Return the scope that is being written."""
        return self.scopes[-1]

    def uses_of(self, kind: str) -> list[tuple[int, str]]:
        """Return the rules of a kind that use what was defined."""
        weight = sum(weight for weight, _ in self.grammar.statements) // 12 if kind == "STATEMENT" else 8
        return [(weight, use) for scope in self.scopes for use in scope.uses.get(kind, ())]

    def expression(self, kind: str) -> ast.expr:
        """Return a random expression."""
        names = [(3, name) for name in self.here.readable.get(kind, ())]
        given = self.grammar.weighed[kind]
        if self.plain and names:
            return ast.Name(self.pick(names), ast.Load())
        if self.plain or self.expressions >= DEEPEST_EXPRESSION:
            choices = [*(r for r in given if is_leaf(r[1])), *names]
        else:
            choices = [*given, *names, *self.uses_of(kind)]
        if not self.walrus:
            choices = [r for r in choices if ":=" not in r[1]]
        self.expressions += 1
        node = self.fill(ast.parse(self.pick(choices), mode="eval").body)
        self.expressions -= 1
        return node  # type: ignore[no-any-return]  # as `visit` is typed

    def statements(self, count: int) -> list[ast.stmt]:
        """Return random statements."""
        return [node for _ in range(count) for node in self.statement()]

    def statement(self) -> list[ast.stmt]:
        """Return a random statement, or several that belong together."""
        given = self.grammar.without_blocks if self.blocks >= DEEPEST_BLOCK else self.grammar.statements
        if self.may_be_strange and self.number(9) == 8:  # noqa: PLR2004 - one in nine
            self.may_be_strange, given = False, self.grammar.strange
        uses = self.uses_of("STATEMENT")
        if self.blocks >= DEEPEST_BLOCK:
            uses = [use for use in uses if "BLOCK" not in use[1]]
        rule = self.pick([*given, *uses])
        if rule == "JUMP":
            return [self.jump()]
        self.blocks += 1
        nodes = self.fill_statements(rule)
        self.blocks -= 1
        return nodes

    def jump(self) -> ast.stmt:
        """Return a random statement that leaves a block and is allowed here, or `pass`."""
        choices = [(2, "pass")]
        if self.here.loops:
            choices += [(6, "break"), (3, "continue")]
        if self.here.kind != "module":
            choices += [(1, "return"), (1, "return TEXT")]
        return self.fill_statements(self.pick(choices))[0]

    def definitions(self) -> list[ast.stmt]:
        """Return random functions and classes for the beginning of a scope."""
        return [node for _ in range(self.number(4 - len(self.scopes))) for node in self.definition()]

    def definition(self) -> list[ast.stmt]:
        """Return a random function or class, which later code in the scope can use."""
        definition = self.grammar.definitions[self.number(len(self.grammar.definitions))]
        self.defined += 1
        name = f"f{self.defined}"
        blocks, self.blocks = self.blocks, max(self.blocks, 1)
        nodes = self.fill_statements(re.sub(r"\bF\b", name, definition.text))
        self.blocks = blocks
        for kind, use in definition.uses:
            self.here.uses.setdefault(kind, []).append(re.sub(r"\bF\b", name, use))
        return nodes

    # --- filling rules

    def fill(self, node: ast.AST) -> Any:  # noqa: ANN401 - a node of the same kind
        """Replace the names in capitals in a rule. All uses of `T` in it become the same variable."""
        chosen, self.chosen = self.chosen, {}
        node = self.visit(node)
        self.chosen = chosen
        return node

    def fill_statements(self, rule: str) -> list[ast.stmt]:
        """Return the statements of a rule with their names in capitals replaced."""
        module: ast.Module = self.fill(ast.parse(rule))
        return module.body

    def visit(self, node: ast.AST) -> Any:  # noqa: ANN401 - the replacement may have any type
        """Replace a node with random code if it is a placeholder."""
        match node:
            case ast.Name():
                return self.name(node)
            case ast.Expr(ast.Name("BLOCK")):
                return self.statements(1 + self.number(2))
            case ast.Expr(ast.Name("JUMP")):
                return [self.jump()]
            case ast.ListComp() | ast.SetComp() | ast.DictComp() | ast.GeneratorExp():
                self.fill_comprehension(node)
            case ast.For() | ast.While():
                self.fill_loop(node)
            case ast.FunctionDef() | ast.Lambda():
                self.function(node)
            case ast.JoinedStr():  # only names, because f-strings before Python 3.12 cannot nest quotes
                plain, self.plain = self.plain, True
                self.generic_visit(node)
                self.plain = plain
            case _:
                return self.generic_visit(node)
        return node

    def name(self, node: ast.Name) -> ast.expr:
        """Return the replacement of a name in capitals."""
        if node.id in self.grammar.weighed:
            return self.expression(node.id)
        if node.id in VARIABLES or node.id == "T2":
            if node.id not in self.chosen:
                count = COUNT if self.here.kind == "module" else 1
                self.chosen[node.id] = f"{node.id[0].lower()}{self.number(count)}"
            return ast.Name(self.chosen[node.id], node.ctx)
        return ast.Name(f"i{self.items}", node.ctx) if node.id == "ITEM" else node

    def fill_comprehension(self, node: ast.ListComp | ast.SetComp | ast.DictComp | ast.GeneratorExp) -> None:
        """Fill a comprehension. Its first iterable cannot use the variables of the comprehension."""
        walrus, self.walrus = self.walrus, False
        first = node.generators[0]
        first.iter = self.visit(first.iter)
        self.items += 1
        with self.add_names({"TEXT": [f"i{self.items}"]}):
            for generator in node.generators:
                self.walrus = False
                generator.target = self.visit(generator.target)
                if generator is not first:
                    generator.iter = self.visit(generator.iter)
                self.walrus = walrus
                generator.ifs = [self.visit(test) for test in generator.ifs]
            for part in ("elt", "key", "value"):
                if hasattr(node, part):
                    setattr(node, part, self.visit(getattr(node, part)))
        self.items -= 1

    @contextmanager
    def add_names(self, names: dict[str, list[str]]) -> Iterator[None]:
        """Let the block read some more names."""
        before = self.here.readable
        self.here.readable = {kind: before[kind] + names.get(kind, []) for kind in before}
        yield
        self.here.readable = before

    def fill_loop(self, node: ast.For | ast.While) -> None:
        """Fill a loop. Its `else` branch is not inside the loop."""
        for part in ("target", "iter", "test"):
            if hasattr(node, part):
                setattr(node, part, self.visit(getattr(node, part)))
        self.here.loops += 1
        node.body = self.visit_all(node.body)
        self.here.loops -= 1
        node.orelse = self.visit_all(node.orelse)

    def visit_all(self, body: list[ast.stmt]) -> list[ast.stmt]:
        """Return the statements that replace the given ones."""
        module: ast.Module = self.generic_visit(ast.Module(body, []))  # type: ignore[assignment]  # a module
        return module.body

    def function(self, node: ast.FunctionDef | ast.Lambda) -> None:
        """Fill a function, whose body can use the parameters."""
        if isinstance(node, ast.FunctionDef):
            node.decorator_list = [self.visit(one) for one in node.decorator_list]
        node.args = self.visit(node.args)
        with self.add_names(parameters(node.args)):
            if isinstance(node, ast.FunctionDef):
                given = node.body
                node.body = self.function_body(lambda: self.visit_all(given))
            else:
                walrus, self.walrus = self.walrus, False
                node.body = self.visit(node.body)
                self.walrus = walrus

    def function_body(self, write: Callable[[], list[ast.stmt]]) -> list[ast.stmt]:
        """Return the body of a function: its variables, perhaps inner functions, then other statements."""
        outer = self.here.kind
        kinds = ["local", "global", *(["nonlocal"] if outer in ("local", "nonlocal") else [])]
        kind = kinds[self.number(len(kinds))]
        first = [name.lower() + "0" for name in VARIABLES]
        if kind == "local":
            head = "; ".join(f"{name.lower()}0 = {START[name]}" for name in VARIABLES)
        else:
            head = f"{kind} {', '.join(first)}"
        self.scopes.append(Scope(kind, self.here.readable, {}))
        before = self.walrus, self.chosen
        self.walrus, self.chosen = True, {}
        body = ast.parse(head).body
        if len(self.scopes) <= DEEPEST_DEFINITION:
            body += self.definitions()
        body += write()
        self.walrus, self.chosen = before
        self.scopes.pop()
        return body


@cache
def numbers(below: int) -> st.SearchStrategy[int]:
    """Return a strategy for numbers from 0 to less than `below`."""
    return st.integers(0, max(0, below - 1))


@cache
def is_leaf(rule: str) -> bool:
    """Return whether a rule has no names to replace."""
    return not re.search(r"\b(?:[A-Z]{3,}|[TNLD])\b", rule)


def parameters(given: ast.arguments) -> dict[str, list[str]]:
    """Return the names of parameters by the kind of their value."""
    found: dict[str, list[str]] = {}
    for one in (*given.posonlyargs, *given.args, *given.kwonlyargs):
        if one.arg in PARAMETERS:
            found.setdefault(PARAMETERS[one.arg], []).append(one.arg)
    return found


@st.composite
def programs(draw: st.DrawFn, *, deep: bool = True) -> str:
    """Generate programs that parse, mostly do something, and often finish.

    Args:
        draw: a function that Hypothesis provides.
        deep: whether to include programs that end differently under different versions of Python, because
            they call themselves through C until the stack is full.
    """
    return Writer(draw, DEEP if deep else USUAL).program()


@st.composite
def tame_programs(draw: st.DrawFn) -> str:
    """Generate programs that parse. Most of them are tame, and the others are so except for one statement."""
    return Writer(draw, TAME, "time").program()


TOKENS = re.compile(r"\w+|\s+|[^\w\s]")
FOREIGN = (
    *("\t", "\f", "\r", "\n", "\\", "'", '"""', "(", "]", "{", ":", "=", "*", "#", "@", "$", "f'{"),
    *("lambda", "async ", "0x", "1_", "\ufeff", "\u2028", "\xa0", "ﬁ", "²", "\x00", "\ud800", "\U000e0100"),
    "# -*- coding: utf-7 -*-",
)


@st.composite
def broken_programs(draw: st.DrawFn) -> str:
    """Generate programs with missing, duplicated or swapped lines and tokens, and with foreign characters."""
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
