"""Collects the correct programs of a task and creates their distinct mutants."""

from __future__ import annotations

import difflib
import hashlib
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, zip_longest

from codebotler.core.cachedproperty import cached_property
from roboeval.mutation.operator import Context, Operator, operators_in
from roboeval.mutation.operators import control_flow, counting, manipulation, misuse, navigation, speech
from roboeval.mutation.program_tree import ProgramTree, apply_edit, parse_tree
from roboeval.suites.load import Task
from roboeval.suites.solutions import bare_diff, solutions

OPERATOR_MODULES = navigation, speech, manipulation, counting, control_flow, misuse
MUTATION_OPERATORS = tuple(chain.from_iterable(map(operators_in, OPERATOR_MODULES)))


@dataclass(frozen=True)
class Original:
    """A program from which mutants are made, provided that it passes the task's checks."""

    name: str
    program: str
    declared_right: bool = True  # whether the author declares it to be right

    @cached_property
    def tree(self) -> ProgramTree | None:
        """The syntax tree, or None if the program does not parse."""
        return parse_tree(self.program)

    @property
    def text(self) -> str:
        """The program formatted by `ast.unparse`, or its source if it does not parse."""
        return self.program if self.tree is None else self.tree.text


@dataclass(frozen=True)
class Mutant:
    """A correct program into which a mutation operator has introduced a mistake."""

    operator: str
    original: Original
    program: str  # formatted by `ast.unparse`

    @cached_property
    def diff(self) -> str:
        """The difference from the original as a unified diff, without file names."""
        before, after = self.original.text.splitlines(), self.program.splitlines()
        return "\n".join([*difflib.unified_diff(before, after, lineterm="")][2:]) + "\n"

    @property
    def key(self) -> tuple[str, str]:
        """The operator and the diff, which identify the mutant in the list of equivalent mutants."""
        return self.operator, bare_diff(self.diff)


def originals(task: Task, further: Iterable[Original] = ()) -> tuple[Original, ...]:
    """Return a task's right solutions, then the `further` programs, without equal syntax trees."""
    right = (Original(one.about, one.program) for one in solutions(task) if one.fails is None or one.right)
    distinct: dict[str, Original] = {}
    for original in chain(right, further):
        distinct.setdefault(original.text, original)
    return tuple(distinct.values())


def mutants(
    right: Sequence[Original], context: Context, operators: Iterable[Operator] = MUTATION_OPERATORS
) -> Iterator[Mutant]:
    """Yield all distinct mutants of correct programs, except those that are equal to a correct program."""
    seen = {original.text for original in right}
    for original in right:
        if (tree := original.tree) is None:
            continue
        for operator in operators:
            for edit in operator.edits(tree, context):
                program = apply_edit(tree, edit)
                if program is not None and program not in seen:
                    seen.add(program)
                    yield Mutant(operator.name, original, program)


def sample_mutants(every: Iterable[Mutant], most: int, seed: int) -> tuple[Mutant, ...]:
    """Sample up to `most` mutants evenly across operators. The order of `every` does not matter."""

    def random_key(mutant: Mutant) -> bytes:
        return hashlib.sha256(f"{seed}\n{mutant.program}".encode(errors="surrogatepass")).digest()

    by_operator: dict[str, list[Mutant]] = defaultdict(list)
    for mutant in every:
        by_operator[mutant.operator].append(mutant)
    shuffled = [sorted(by_operator[name], key=random_key) for name in sorted(by_operator)]
    turns = zip_longest(*shuffled)
    return tuple([one for turn in turns for one in turn if one is not None][:most])
