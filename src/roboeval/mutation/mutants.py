"""Right programs, and the distinct mutants made of them."""

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
from roboeval.mutation.program_tree import ProgramTree, changed, read
from roboeval.suites.load import Task
from roboeval.suites.solutions import bare_diff, solutions

MODULES = navigation, speech, manipulation, counting, control_flow, misuse
OPERATORS = tuple(chain.from_iterable(map(operators_in, MODULES)))


@dataclass(frozen=True)
class Original:
    """A program to be mutated."""

    name: str
    program: str
    claimed: bool = True  # to be right, by its author

    @cached_property
    def tree(self) -> ProgramTree | None:
        """Its tree; None if it has none."""
        return read(self.program)

    @property
    def text(self) -> str:
        """The text that all programs with the same tree share; the source if there is no tree."""
        return self.program if self.tree is None else self.tree.text


@dataclass(frozen=True)
class Mutant:
    """A program made by an operator."""

    operator: str
    original: Original
    program: str  # as `ast.unparse` writes it

    @cached_property
    def diff(self) -> str:
        """The change as lines of a unified diff, without file names."""
        before, after = self.original.text.splitlines(), self.program.splitlines()
        return "\n".join([*difflib.unified_diff(before, after, lineterm="")][2:]) + "\n"

    @property
    def key(self) -> tuple[str, str]:
        """Its key in the list of equivalent mutants."""
        return self.operator, bare_diff(self.diff)


def originals(task: Task, further: Iterable[Original] = ()) -> tuple[Original, ...]:
    """The right solutions of a task, and further programs; of those with the same tree the first."""
    right = (Original(one.about, one.program) for one in solutions(task) if one.fails is None or one.right)
    distinct: dict[str, Original] = {}
    for original in chain(right, further):
        distinct.setdefault(original.text, original)
    return tuple(distinct.values())


def mutants(
    right: Sequence[Original], context: Context, operators: Iterable[Operator] = OPERATORS
) -> Iterator[Mutant]:
    """All mutants of right programs: of those with the same tree the first, and no right program again."""
    seen = {original.text for original in right}
    for original in right:
        if (tree := original.tree) is None:
            continue
        for operator in operators:
            for edit in operator.edits(tree, context):
                program = changed(tree, edit)
                if program is not None and program not in seen:
                    seen.add(program)
                    yield Mutant(operator.name, original, program)


def drawn(every: Iterable[Mutant], most: int, seed: int) -> tuple[Mutant, ...]:
    """Draw at most `most` mutants, evenly over the operators, whatever the order of `every`."""

    def lot(mutant: Mutant) -> bytes:
        return hashlib.sha256(f"{seed}\n{mutant.program}".encode(errors="surrogatepass")).digest()

    by_operator: dict[str, list[Mutant]] = defaultdict(list)
    for mutant in every:
        by_operator[mutant.operator].append(mutant)
    shuffled = [sorted(by_operator[name], key=lot) for name in sorted(by_operator)]
    turns = zip_longest(*shuffled)
    return tuple([one for turn in turns for one in turn if one is not None][:most])
