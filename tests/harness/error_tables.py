"""The tables of errors in the guides: each message must be one that the code can say."""

from __future__ import annotations

import re
from pathlib import Path

ROBOTS = Path(__file__).parents[2] / "src" / "codebotler" / "robots"
HEAD = "## What the errors mean"


def errors_on(page: str) -> list[str]:
    """The messages in a page's table."""
    return re.findall(r"^\| `(.*?)` \| ", page.partition(HEAD)[2], re.MULTILINE)


def unsaid(page: str, varies: str) -> list[tuple[str, str]]:
    """The messages that no code says, each with the phrase that is not found.

    Args:
        page: its text.
        varies: a regex of what differs from one message to the next.
    """
    source = "".join(path.read_text() for path in ROBOTS.rglob("*.py"))
    source = re.sub(r'"\s*\n\s*f?"', "", source)
    source = re.sub(r'"\s*\n\s*\+ \(f" ', " ", source)
    source = re.sub(r"\{[^}]*\}", "…", source).replace("\\", "")
    phrases = [
        (error, each.strip(" :;,()`\"'")) for error in errors_on(page) for each in re.split(varies, error)
    ]
    return [(error, phrase) for error, phrase in phrases if phrase not in source]
