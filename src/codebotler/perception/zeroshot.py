"""Zero-shot object detectors of transformers, such as OWL-ViT, on this machine."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import torch
import transformers
from PIL.Image import Image

from codebotler.core.errors import UserError
from codebotler.models.redaction import guard_logs
from codebotler.models.server_errors import brief
from codebotler.perception.base import PerceptionError, Sighting, named

TASK = "zero-shot-object-detection"


class ZeroShot:
    """A zero-shot object detector, on a GPU where there is one.

    Args:
        path: a folder, or a name on the Hugging Face hub.
        least_score: from which score on, above 0 and up to 1, something is found.

    Raises:
        UserError: it cannot be loaded, or the score is out of its range.
    """

    def __init__(self, path: str, *, least_score: float) -> None:
        self.name = f"hf:{path}"
        if not 0 < least_score <= 1:
            raise UserError(f"the least score is {least_score:g}, but it must be above 0 and at most 1")
        if path.startswith((".", "/", "~")) and not Path(path).expanduser().is_dir():
            raise UserError("there is no such folder of a model", file=path)
        self._least = least_score
        transformers.utils.logging.disable_progress_bar()
        os.environ.setdefault("TOKENIZERS_PARALLELISM", "false")  # else it complains at every label
        try:
            self._pipeline: Any = transformers.pipeline(
                TASK, model=str(Path(path).expanduser()), device=0 if torch.cuda.is_available() else "cpu"
            )
        except Exception as error:  # noqa: BLE001 - a model's own code and files, wrong in many ways
            raise UserError(f"{self.name} cannot be loaded as a zero-shot detector: {brief(error)}") from None
        guard_logs()
        if not all(bool(torch.isfinite(weight).all()) for weight in self._pipeline.model.parameters()):
            raise UserError(f"{self.name} has weights that are no numbers, so that it would find nothing")

    def look(self, image: Image, label: str) -> Sighting:
        """Look for the label's words; the clearest place counts.

        Raises:
            UserError: the label is no name, or has too many words for the model.
            PerceptionError: the model fails at it.
        """
        words = named(label)
        self._check_length(words)
        try:
            # The labels are a list, for in one text a comma would part them.
            places = self._pipeline(image, candidate_labels=[words], threshold=0.0, top_k=1)
        except Exception as error:  # noqa: BLE001 - a model's own code, which may fail in many ways
            raise PerceptionError(f"{self.name}: {brief(error)}") from None
        if not places:
            return Sighting(found=False, box=None, score=0.0)
        score, box = float(places[0]["score"]), places[0]["box"]
        if score < self._least:
            return Sighting(found=False, box=None, score=score)
        width, height = image.size
        left, right = _within(box["xmin"], box["xmax"], width)
        top, bottom = _within(box["ymin"], box["ymax"], height)
        return Sighting(found=True, box=(left, top, right, bottom), score=score)

    def close(self) -> None:
        """Give the model back."""
        del self._pipeline

    def _check_length(self, words: str) -> None:
        length = len(self._pipeline.tokenizer(words)["input_ids"])
        text = getattr(self._pipeline.model.config, "text_config", None)
        most = getattr(text, "max_position_embeddings", None) or length
        if length > most:
            raise UserError(
                f'the name "{words}" has {length} tokens, but {self.name} takes only {most}; shorten it'
            )


def _within(first: int, last: int, side: int) -> tuple[float, float]:
    """Two edges in pixels as shares of a side, for detectors find things that go on beyond the picture."""
    start = min(max(first, 0), side - 1)
    end = min(max(last, start + 1), side)
    return start / side, end / side
