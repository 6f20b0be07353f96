"""Tell code, prose and chat template tokens apart, line by line."""

from __future__ import annotations

import ast
import keyword
import re
from collections.abc import Sequence
from functools import lru_cache

from codebotler.core.program import Flaw, parse_program

MARKUP = r"(?:</?[A-Za-z][\w:.-]*>|<[|\uff5c][^<>\n]*[|\uff5c]>|\[/\w+\]|\[[A-Z_]{3,}\])"
RESIDUE_LINE = re.compile(rf"(?:{MARKUP}\s*)*(?:[Pp]ython3?|py|[Aa]ssistant|model)?")
RESIDUE = re.compile(
    rf"^(?:{MARKUP}(?:assistant|python|final)?[ ]?)+|(?<=[^\s`])(?:\s*(?:{MARKUP}|`{{3,}})){{1,9}}\s*$"
)
KEYWORDS = "|".join((*(word for word in keyword.kwlist if word.islower()), "match", "case", "print", "exec"))
WORD = rf"(?!(?:{KEYWORDS})\b)[^\W\d_][\w'\u2019-]*"
ADJACENT_WORDS = re.compile(rf"\b{WORD}\s+{WORD}")  # two words that are never adjacent in code
STRING = re.compile(r"""("|').*?(?:\1|$)|\#.*""")
STATEMENT = re.compile(
    r"""\s*(?:
      \# | @\w | (?:async\s+)?def\s+\w+\s*\( | class\s+\w+\s*[(:] | import\s+\w | from\s+[\w.]+\s+import\b
    | [^\W\d][\w.]*(?:\s*,\s*[^\W\d][\w.]*)*(?:\[[^\]]*\])?\s*
      (?::\s*[\w.]+(?:\[.*\])?\s*)?(?:[-+*/%|&^@]|//|\*\*|<<|>>)?=(?!=)                     # an assignment
    )""",
    re.VERBOSE,
)
CALL_START = re.compile(r"\s*[^\W\d][\w.]*\(")
PROSE = re.compile(
    rf"""[ ]?(?:
      (?:[-*+>•\u2013]|\d+[.)])\s | \*\* | ` | [-=*_]{{3,}}\s*$ | </?[\w|] | [^\x00-\x7f]  # Markdown, tags
    | {WORD}(?:[,:;.!?]?\s+[\w`*“]|[:.!?…]+\s*$)                                           # words
    )""",
    re.VERBOSE,
)
INTERJECTION = re.compile(r" ?[A-Z][a-z]+\s*$")


def is_prose(line: str) -> bool:
    """Whether a line is certainly not code. A doubtful line counts as code, so that no code is lost."""
    line = without_residue(line)
    if INTERJECTION.match(line) or (line.strip() and is_residue(line)):
        return True
    is_sentence = PROSE.match(line) or (re.match(r" ?\S", line) and _has_words(line))
    return bool(is_sentence) and not is_code(line) and parse_lines([line.strip()]) is None


def continues_prose(line: str) -> bool:
    """Whether a line after prose continues the prose, that is, whether it is neither blank nor code."""
    return bool(line.strip()) and not is_code(without_residue(line))


def is_code(line: str) -> bool:
    """Whether a line begins like code. A sentence such as `go_to(room) drives there` is not code."""
    return bool(STATEMENT.match(line) or (CALL_START.match(line) and not _has_words(line)))


def _has_words(line: str) -> bool:
    return bool(ADJACENT_WORDS.search(STRING.sub("''", line)))


def is_residue(line: str) -> bool:
    """Whether a line is blank or consists of chat template tokens, such as `<|assistant|>`."""
    return bool(RESIDUE_LINE.fullmatch(line.strip()))


def trim(lines: Sequence[str]) -> Sequence[str]:
    """Strip lines from both ends that are blank or contain only chat template tokens."""
    kept = [i for i, line in enumerate(lines) if not is_residue(line)]
    return lines[kept[0] : kept[-1] + 1] if kept else []


def without_residue(line: str) -> str:
    """Strip chat template tokens from both ends of a line, and a code fence from its end."""
    while (shorter := RESIDUE.sub("", line)) != line:
        line = shorter
    return line


def parse_lines(lines: Sequence[str]) -> ast.Module | None:
    """Parse lines of code. Return their syntax tree, or None if they are not valid Python."""
    return _parse_text("\n".join(lines))


@lru_cache(maxsize=64)  # enough for all parts of a reply
def _parse_text(text: str) -> ast.Module | None:
    tree = parse_program(text)
    return None if isinstance(tree, Flaw) else tree
