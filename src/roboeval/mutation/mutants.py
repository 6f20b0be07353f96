"""Right programs, and the distinct mutants that operators make of them."""

from __future__ import annotations

import difflib
import hashlib
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, zip_longest

from codebotler.cachedproperty import cached_property
from roboeval.mutation.operator import Operator, Setting
from roboeval.mutation.operators import OPERATORS
from roboeval.mutation.rewriting import Source, changed, read
from roboeval.suites.load import Task
from roboeval.suites.solutions import solutions


@dataclass(frozen=True)
class Original:
    """A program that mutants are made of.

    Args:
        name: what is special about it, or where it comes from.
        program: its source.
        claimed: whether whoever wrote it says that it is right.
    """

    name: str
    program: str
    claimed: bool = True

    @cached_property
    def source(self) -> Source | None:
        """It as operators read it; None where they cannot."""
        return read(self.program)

    @property
    def text(self) -> str:
        """What all programs with the same tree share; as it stands where there is none."""
        return self.program if self.source is None else self.source.text


@dataclass(frozen=True)
class Mutant:
    """A program that an operator made of an original.

    Args:
        operator: its name.
        original: of which it was made.
        program: its source, in the one way in which trees are written.
    """

    operator: str
    original: Original
    program: str

    @cached_property
    def diff(self) -> str:
        """What was changed, as lines of a unified diff, without names of files."""
        before, after = self.original.text.splitlines(), self.program.splitlines()
        return "\n".join([*difflib.unified_diff(before, after, lineterm="")][2:]) + "\n"


def originals(task: Task, further: Iterable[Original] = ()) -> tuple[Original, ...]:
    """The programs for a task that may be right: its right solutions, and further ones.

    Of programs with the same tree only the first is among them.

    Args:
        task: the task.
        further: programs that a user names.

    Raises:
        BadInput: a file of solutions is wrong.
    """
    right = (one for one in solutions(task) if one.fails is None or one.right)
    written = (Original(one.about, one.program) for one in right)
    distinct: dict[str, Original] = {}
    for original in chain(written, further):
        distinct.setdefault(original.text, original)
    return tuple(distinct.values())


def mutants(
    right: Sequence[Original], setting: Setting, operators: Iterable[Operator] = OPERATORS
) -> Iterator[Mutant]:
    """All mutants of right programs, those with the same tree once, and none that is a right program again.

    Args:
        right: programs.
        setting: the names that operators put in place of others.
        operators: what makes mutants.
    """
    seen = {original.text for original in right}
    for original in right:
        if original.source is None:
            continue
        for operator in operators:
            for edit in operator(original.source, setting):
                program = changed(original.source, edit)
                if program is not None and program not in seen:
                    seen.add(program)
                    yield Mutant(operator.name, original, program)


def drawn(every: Iterable[Mutant], most: int, seed: int) -> tuple[Mutant, ...]:
    """Some of the mutants, as evenly over the operators as there are mutants of each.

    Args:
        every: mutants; their order makes no difference.
        most: how many at most.
        seed: from which they are drawn; the same seed draws the same ones.
    """
    by_operator: dict[str, list[Mutant]] = defaultdict(list)
    for mutant in every:
        by_operator[mutant.operator].append(mutant)
    shuffled = [sorted(by_operator[name], key=_lot(seed)) for name in sorted(by_operator)]
    turns = zip_longest(*shuffled)
    return tuple([one for turn in turns for one in turn if one is not None][:most])


def _lot(seed: int) -> Callable[[Mutant], bytes]:
    return lambda mutant: hashlib.sha256(f"{seed}\n{mutant.program}".encode(errors="surrogatepass")).digest()
