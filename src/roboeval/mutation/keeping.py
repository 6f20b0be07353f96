"""Mutation scores as files: the numbers, every mutant, and the survivors as a list to fill in."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from codebotler.files import to_line, to_text, write_whole
from roboeval.mutation.scores import Score
from roboeval.mutation.stillright import to_yaml


def keep(scores: Sequence[Score], folder: Path) -> None:
    """Write scores.json, mutants/TASK.jsonl and survivors/TASK.yaml; what stood there before is replaced.

    A file of survivors is a list of mutants that are still right, where each waits for its reason.

    Args:
        scores: of tasks.
        folder: made if it is not there.

    Raises:
        OSError: a file cannot be written.
    """
    for score in scores:
        rows = b"".join(to_line(trial.data()) for trial in score.trials)
        write_whole(folder / "mutants" / f"{score.task}.jsonl", rows)
        survivors = folder / "survivors" / f"{score.task}.yaml"
        if score.survivors:
            text = to_yaml([trial.mutant for trial in score.survivors])
            write_whole(survivors, text.encode(errors="backslashreplace"))
        else:
            survivors.unlink(missing_ok=True)
    write_whole(folder / "scores.json", to_text({"tasks": [score.data() for score in scores]}))
