"""Remove the seals of evaluations, so that tests may change their rows."""

from __future__ import annotations

import json
from pathlib import Path

from codebotler.core.files import to_text
from roboeval.evaluation.runs.folder import RunFolder


def unseal(run: Path, key: str = "paper") -> None:
    """Mark an evaluation as unfinished, so that its rows may change."""
    path = RunFolder(run).manifest(key)
    head = json.loads(path.read_text())
    path.write_bytes(to_text({name: value for name, value in head.items() if name not in {"rows", "sha256"}}))
