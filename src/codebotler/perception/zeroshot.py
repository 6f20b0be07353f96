"""Zero-shot object detectors of transformers, such as OWL-ViT, on this machine."""

from __future__ import annotations

import os
from typing import Any

import torch
import transformers
from PIL.Image import Image

from codebotler.core.errors import UserError
from codebotler.models.keys import guard_logs
from codebotler.models.local import source_of
from codebotler.models.server_errors import error_text
from codebotler.perception.base import PerceptionError, Sighting, checked_label

TASK = "zero-shot-object-detection"


class ZeroShotDetector:
    """A zero-shot object detector, on a GPU where there is one."""

    def __init__(self, path: str, *, least_score: float) -> None:
        self.name = f"hf:{path}"
        if not 0 < least_score <= 1:
            raise UserError(f"the least score is {least_score:g}, but it must be above 0 and at most 1")
        self._least = least_score
        source = source_of(path)
        transformers.utils.logging.disable_progress_bar()
        os.environ.setdefault("TOKENIZERS_PARALLELISM", "false")  # else it complains at every label
        try:
            device = 0 if torch.cuda.is_available() else "cpu"
            self._pipeline: Any = transformers.pipeline(TASK, model=source, device=device)
        except Exception as error:  # noqa: BLE001 - a model's own code and files, wrong in many ways
            raise UserError(
                f"{self.name} cannot be loaded as a zero-shot detector: {error_text(error)}"
            ) from None
        guard_logs()
        if not all(bool(torch.isfinite(weight).all()) for weight in self._pipeline.model.parameters()):
            raise UserError(f"{self.name} has weights that are not numbers, so it would find nothing")

    def look(self, image: Image, label: str) -> Sighting:
        """Look for the label; the clearest place counts."""
        words = checked_label(label)
        self._check_length(words)
        try:
            # A list, because the pipeline would split a text at its commas.
            places = self._pipeline(image, candidate_labels=[words], threshold=0.0, top_k=1)
        except Exception as error:  # noqa: BLE001 - a model's own code
            raise PerceptionError(f"{self.name}: {error_text(error)}") from None
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
        """Release the memory of the model."""
        del self._pipeline

    def _check_length(self, words: str) -> None:
        length = len(self._pipeline.tokenizer(words)["input_ids"])
        text = getattr(self._pipeline.model.config, "text_config", None)
        most = getattr(text, "max_position_embeddings", None) or length
        if length > most:
            raise UserError(
                f'the label "{words}" has {length} tokens, but {self.name} takes only {most}; shorten it'
            )


def _within(first: int, last: int, side: int) -> tuple[float, float]:
    """Two edges in pixels as shares of a side; detectors also find things beyond the picture's edge."""
    start = min(max(first, 0), side - 1)
    end = min(max(last, start + 1), side)
    return start / side, end / side
