"""Files of each kind, damaged in each of five ways, are read or refused in a sentence with a line."""

import random
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from codebotler.core.errors import UserError
from codebotler.core.world_file import WorldFile
from codebotler.core.yaml_files import YamlFile
from roboeval.suites.load import SUITES, read_task
from roboeval.suites.schema import SuiteFile
from roboeval.suites.solutions import SolutionsFile

WORLD = (Path(__file__).parents[1] / "examples" / "office.yaml").read_text()
SUITE = """\
name: mine
version: 1
rules:
  limits: {calls: 7, seconds: 3.5, ticks: 9}
  clock_starts: 2024-01-01T12:00:00+00:00
"""
BITS = (
    *("[", "]", "{", "}", ":", " - ", "\n", "  ", "'", '"', "|", ">", "&a ", "*a ", "? ", "#", "%", "@", "`"),
    *("!!set ", "!!int ", "!!float ", "!!bool ", "!!timestamp ", "!!str ", "!!omap ", "!!null ", "!x "),
    *("~", "null", "yes", "1e999", ".nan", "0x_", "9" * 400, "9" * 5000, "2001-13-01", "=", "<<: ", "1:2"),
    *(
        "\0",
        "\x07",
        "\x85",
        "\u2028",
        "\ufeff",
        "\t",
        "(",
        "*",
        "\\",
        "a{9999999999}",
        "...\n",
        "---\n",
    ),
)


def read_world(file: YamlFile) -> object:
    return file.validate(WorldFile).world(file)


def read_solutions(file: YamlFile) -> object:
    return file.validate(SolutionsFile)


def read_suite(file: YamlFile) -> object:
    return file.validate(SuiteFile).rules.settings()


Read = Callable[[YamlFile], object]
TASKS: list[tuple[str, Read]] = [
    (path.read_text(), partial(read_task, path=path)) for path in sorted(SUITES.glob("paper/tasks/*.yaml"))
]
SOLUTIONS: list[tuple[str, Read]] = [
    (path.read_text(), read_solutions) for path in sorted(SUITES.glob("*/solutions/SayGoodDay.yaml"))
]


def damage(text: str, chance: random.Random, kind: int) -> str:
    """Return a string with small damage of one of five kinds."""
    for _ in range(chance.choice([1, 1, 1, 2, 3])):
        at = chance.randrange(len(text) + 1)
        lines = text.split("\n")
        row, other = chance.randrange(len(lines)), chance.randrange(len(lines))
        match kind:
            case 0:
                text = text[:at] + chance.choice(BITS) + text[at:]
            case 1:
                text = text[:at] + text[at + chance.randrange(1, 6) :]
            case 2:
                character = chr(chance.choice([chance.randrange(128), chance.randrange(0x110000)]))
                text = text[:at] + character + text[at + 1 :]
            case 3:
                lines[row], lines[other] = lines[other], lines[row]
                text = "\n".join(lines)
            case 4:
                lines[row] = lines[row].partition(":")[0] + ": " + chance.choice(BITS)
                text = "\n".join(lines)
    return text


@pytest.mark.parametrize(
    "files",
    [
        pytest.param([(WORLD, read_world)], id="worlds"),
        pytest.param([(SUITE, read_suite)], id="suites"),
        pytest.param(TASKS, id="tasks"),
        pytest.param(SOLUTIONS, id="solutions"),
    ],
)
def test_a_damaged_file_is_read_or_refused_in_a_sentence_with_a_line(files: list[tuple[str, Read]]) -> None:
    chance = random.Random(20)
    refused: Counter[int] = Counter()
    for number in range(75):
        text, read = chance.choice(files)
        text = damage(text, chance, kind=number % 5)
        error = refusal(text, read)
        if error is not None:
            refused[number % 5] += 1
            assert error.line is not None or "the file is empty" in str(error)
            assert 1 <= (error.line or 1) <= len(text.splitlines())
            assert "\n" not in str(error)
            assert len(str(error)) < 700
    assert len(refused) == 5, "every kind of damage is refused at least once"


def refusal(text: str, read: Read) -> UserError | None:
    try:
        read(YamlFile(text, "w.yaml"))
    except UserError as error:
        return error
    return None
